#!/usr/bin/env python3
"""How a farm scales on this machine, from one node of one core to two, and what a task costs beside its frames.

    benches/farm.py --runs 5

Needs Ray (pip install 'bokehcam[farm]') and the program, built here or named by BOKEHCAM. Each run does the same work on one
node and on two, in turn; medians are of the wall time between the first task and the last. With other work on the machine
only the ratio means something.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(REPOSITORY / "python" / "tests"), str(REPOSITORY / "python")]

from farm_fixtures import PROGRAM, Cluster, farm, recording  # noqa: E402

RECORDINGS = 8
FRAMES = 48
SMALL = 60


def timed(cluster: Cluster, sources: list[Path], out: Path, flags: list[str]) -> tuple[float, float]:
    """Seconds from the first task to the last, and of all, with the start of the driver."""
    began = time.monotonic()
    said = farm(*sources, "--out", out, "--format", "y4m", "--address", cluster.address, "--", *flags)
    frames_per_second = float(re.search(r"([0-9.]+) frames/s", said)[1])
    frames = sum(json.loads(path.read_text())["frames"]["delivered"] for path in (out / "reports").iterdir())
    return frames / frames_per_second, time.monotonic() - began


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
    runs = parser.parse_args().runs
    print(f"{PROGRAM}, {RECORDINGS} recordings of {FRAMES} frames, 640x360, one thread each")
    clusters = {1: Cluster(), 2: Cluster()}
    try:
        clusters[2].add()
        with tempfile.TemporaryDirectory() as folder:
            measure(clusters, Path(folder), runs)
    finally:
        for cluster in clusters.values():
            cluster.stop()


def measure(clusters: dict[int, Cluster], folder: Path, runs: int) -> None:
    takes = [recording(folder / f"take{first}", first) for first in range(RECORDINGS)]
    flags = ["--loop", "--frames", str(FRAMES)]
    seconds: dict[int, list[float]] = {1: [], 2: []}
    for run in range(runs):
        for nodes, cluster in clusters.items():
            out = folder / f"out{nodes}-{run}"
            seconds[nodes].append(timed(cluster, takes, out, flags)[0])
            print(f"run {run + 1}, {nodes} node(s): {seconds[nodes][-1]:.1f} s, {cpu_s(out):.1f} s of processor time", flush=True)
    ratios = sorted(one / two for one, two in zip(seconds[1], seconds[2]))
    print(f"median: {statistics.median(seconds[1]):.1f} s on one node, {statistics.median(seconds[2]):.1f} s on two")
    print(f"ratio of each pair: median {statistics.median(ratios):.2f}, from {ratios[0]:.2f} to {ratios[-1]:.2f}")
    trivial, all_of_it = timed(clusters[2], links(folder, takes), folder / "small-out", ["--frames", "1", "--effect", "none"])
    print(f"a task of one frame, not blurred: {1000 * trivial / SMALL:.0f} ms on two nodes; start and end {all_of_it - trivial:.1f} s")


if __name__ == "__main__":
    main()
