#!/usr/bin/env python3
"""How a farm scales on this machine, from one node of one core to two, and what a task costs beside its frames.

    crates/lab/benches/farm.py --runs 5
    crates/lab/benches/farm.py --runs 5 --wait 3

Needs Ray (pip install 'bokehcam[ray]') and the program, built here or named by BOKEHCAM. Each run does the same work on one
node and on two, in turn; each node's processes stay on a core of their own. With other work on the machine only the ratio means
something; with --wait each recording is one frame and so many seconds of sleep, so that the farm alone is measured.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(REPOSITORY / "python" / "tests"), str(REPOSITORY / "python")]

from farm_fixtures import PROGRAM, Cluster, farm, recording  # noqa: E402

RECORDINGS = 12
FRAMES = 36
SMALL = 60


def timed(cluster: Cluster, sources: list[Path], out: Path, flags: list[str], program: Path) -> float:
    """Seconds of all, with the start of the driver and of Ray's workers."""
    began = time.monotonic()
    farm(*sources, "--out", out, "--format", "y4m", "--address", cluster.address, "--bokehcam", program, "--", *flags)
    return time.monotonic() - began


def results_per_s(out: Path, nodes: int) -> float:
    """How fast results came once each node had made its first one: workers are then started."""
    ends_s = sorted(path.stat().st_mtime for path in out.glob("*.y4m"))[nodes - 1 :]
    return (len(ends_s) - 1) / (ends_s[-1] - ends_s[0])


def cpu_s(out: Path) -> float:
    """Processor time of the program for all results."""
    return sum(json.loads(path.read_text())["cpu_s"] for path in (out / "reports").iterdir())


def links(folder: Path, takes: list[Path]) -> list[Path]:
    """Many recordings that take no room."""
    small = [folder / f"small{k}" for k in range(SMALL)]
    for k, link in enumerate(small):
        link.symlink_to(takes[k % len(takes)])
    return small


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--wait", type=float, metavar="SECONDS")
    given = parser.parse_args()
    print(f"{PROGRAM}, {RECORDINGS} recordings of {FRAMES} frames, 640x360, one thread each")
    clusters = {nodes: on_core(0, Cluster) for nodes in (1, 2)}
    try:
        on_core(1, clusters[2].add)
        with tempfile.TemporaryDirectory() as folder:
            measure(clusters, Path(folder), given.runs, given.wait)
    finally:
        for cluster in clusters.values():
            cluster.stop()


def on_core(core: int, start):
    """What `start` makes, its processes on one core: a task of one CPU has threads for more."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {sorted(cores)[core]})
    try:
        return start()
    finally:
        os.sched_setaffinity(0, cores)


def sleeper(folder: Path, wait_s: float) -> Path:
    """The program, late."""
    late = folder / "bokehcam"
    late.write_text(f'#!/bin/sh\ncase "$*" in *" stream "*) sleep {wait_s};; esac\nexec {PROGRAM} "$@"\n')
    late.chmod(0o755)
    return late


def measure(clusters: dict[int, Cluster], folder: Path, runs: int, wait_s: float | None) -> None:
    takes = [recording(folder / f"take{first}", first) for first in range(RECORDINGS)]
    flags = ["--loop", "--frames", str(1 if wait_s else FRAMES)]
    program = sleeper(folder, wait_s) if wait_s else PROGRAM
    seconds: dict[int, list[float]] = {1: [], 2: []}
    rates: dict[int, list[float]] = {1: [], 2: []}
    for run in range(runs):
        for nodes, cluster in clusters.items():
            out = folder / f"out{nodes}-{run}"
            seconds[nodes].append(timed(cluster, takes, out, flags, program))
            rates[nodes].append(results_per_s(out, nodes) * (1 if wait_s else FRAMES))
            rate, all_s = rates[nodes][-1], seconds[nodes][-1]
            times = f"{all_s:.1f} s in all, {cpu_s(out):.1f} s of processor time"
            print(f"run {run + 1}, nodes: {nodes}: {rate:.2f} frames/s, {times}", flush=True)
    for what, of in (("frames/s", rates), ("s in all", seconds)):
        print(f"median: {statistics.median(of[1]):.2f} {what} on one node, {statistics.median(of[2]):.2f} on two")
    ratios = sorted(two / one for one, two in zip(rates[1], rates[2]))
    spread = f"from {ratios[0]:.2f} to {ratios[-1]:.2f}"
    print(f"frames/s, two nodes by one, of each pair: median {statistics.median(ratios):.2f}, {spread}")
    out = folder / "small-out"
    timed(clusters[2], links(folder, takes), out, ["--frames", "1", "--effect", "none"], PROGRAM)
    print(f"a task of one frame, not blurred: {2000 / results_per_s(out, 2):.0f} ms of a node")


if __name__ == "__main__":
    main()
