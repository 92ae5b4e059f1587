"""A farm on two nodes with one core each; workers, nodes and driver are killed in mid-recording."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from farm_fixtures import (
    FLAGS,
    FORMAT,
    FRAMES,
    PROGRAM,
    Cluster,
    alone,
    children_at_work,
    environment,
    farm,
    farm_command,
    is_alive,
    needs_program,
    needs_ray,
    parent_of,
    recording,
    until,
)

pytestmark = [needs_program, needs_ray]
RECORDINGS = 5


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> list[Path]:
    folder = tmp_path_factory.mktemp("recordings")
    return [recording(folder / f"take{first}", first) for first in range(RECORDINGS)]


@pytest.fixture(scope="module")
def expected(sources, tmp_path_factory) -> dict[str, bytes]:
    """Returns the program's results without Ray."""
    folder = tmp_path_factory.mktemp("alone")
    return {f"{source.name}.y4m": alone(source, folder / f"{source.name}.y4m", FLAGS) for source in sources}


def check(out: Path, expected: dict[str, bytes]) -> None:
    """Checks that every result exists once, identical to the byte, with its report, and nothing else."""
    assert len(set(expected.values())) == len(expected), "recordings that are alike show no mix-up"
    assert sorted(os.listdir(out)) == sorted([*expected, "reports", ".bokehcam-farm"])
    assert sorted(os.listdir(out / "reports")) == sorted(f"{name}.json" for name in expected)
    assert os.listdir(out / ".bokehcam-farm") == ["lock"], "parts are left behind"
    for name, bytes_alone in expected.items():
        assert (out / name).read_bytes() == bytes_alone, name
        assert os.stat(out / name).st_nlink == 1
        report = json.loads((out / "reports" / f"{name}.json").read_text())
        assert report["frames"]["delivered"] == FRAMES and report["farm"]["output"] == {"bytes": len(bytes_alone)}


def start(out: Path, sources: list[Path], cluster: Cluster) -> subprocess.Popen:
    command = farm_command(*sources, "--out", out, *FORMAT, "--address", cluster.address, "--", *FLAGS)
    return subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL)


def ended(driver: subprocess.Popen) -> str:
    _, said = driver.communicate(timeout=150)
    assert driver.returncode == 0, said
    return said


def test_results_are_those_of_the_program_alone_and_a_second_start_makes_none(cluster, sources, expected, tmp_path):
    said = ended(start(tmp_path / "out", sources, cluster))
    assert f"{RECORDINGS} of {RECORDINGS} recordings" in said and "over 2 nodes" in said, said
    check(tmp_path / "out", expected)
    again = ended(start(tmp_path / "out", sources, cluster))
    assert "as they were" in again, again
    check(tmp_path / "out", expected)


def test_a_worker_and_a_child_are_killed(cluster, sources, expected, tmp_path):
    out = tmp_path / "out"
    driver = start(out, sources, cluster)

    def at_work() -> list[tuple[int, int]]:
        pairs = [(child, parent_of(child)) for child in children_at_work(out)]
        # Without a parent of its own it has ended, and a signal to process 0 or 1 would reach others.
        return [(child, worker) for child, worker in pairs if worker > 1]

    child, worker = until(at_work, "a recording that is being made")[0]
    os.kill(worker, signal.SIGKILL)
    until(lambda: not is_alive(child), "the death of the program with its worker")
    # Signals to end early are blocked: a truncated recording would pass for a complete one.
    other = until(lambda: [process for process in children_at_work(out) if process != child], "another recording")[0]
    os.kill(other, signal.SIGTERM)
    # Kills the program, not its worker.
    third = until(lambda: [process for process in children_at_work(out) if process not in (child, other)], "a third recording")[
        0
    ]
    os.kill(third, signal.SIGKILL)
    ended(driver)
    check(out, expected)


def test_a_node_is_killed(cluster, sources, expected, tmp_path):
    out = tmp_path / "out"
    driver = start(out, sources, cluster)

    stopped: set[int] = set()

    def on_last() -> list[int]:
        children = children_at_work(out)
        last = [child for child in children if parent_of(parent_of(child)) == cluster.raylets[-1]]
        # The first node is paused, or it could finish all recordings before the second one starts.
        for child in {*children} - {*last} - stopped:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGSTOP)
                stopped.add(child)
        return last

    child = until(on_last, "a recording on the second node")[0]
    cluster.kill_last()
    for other in stopped:
        os.kill(other, signal.SIGCONT)
    until(lambda: not is_alive(child), "the death of the program with its node")
    ended(driver)
    check(out, expected)
    cluster.add()


def pause_child(out: Path) -> int | None:
    """Stops a process that is writing a file for the folder `out`, so that it cannot end before it is killed."""
    for child in children_at_work(out):
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGSTOP)
            if child in children_at_work(out):
                return child
    return None


def test_the_driver_is_killed_and_a_second_start_does_the_rest(cluster, sources, expected, tmp_path):
    out = tmp_path / "out"
    driver = start(out, sources, cluster)
    until(lambda: list(out.glob("*.y4m")), "the first result")
    child = until(lambda: pause_child(out), "another recording that is being made")
    driver.kill()
    driver.communicate()
    until(lambda: not is_alive(child) and not children_at_work(out), "the death of what it had started")
    there = {path.name: path.stat() for path in out.glob("*.y4m")}
    assert 0 < len(there) < RECORDINGS
    assert any((out / ".bokehcam-farm").glob("*-*")), "nothing was left to sweep"
    said = ended(start(out, sources, cluster))
    assert f"{RECORDINGS - len(there)} made now" in said and f"{len(there)} before" in said, said
    check(out, expected)
    for name, state in there.items():
        now = os.stat(out / name)
        assert (now.st_ino, now.st_mtime_ns) == (state.st_ino, state.st_mtime_ns), name


def test_what_fails_for_good_is_listed_and_the_rest_is_made(cluster, sources, expected, tmp_path):
    broken = recording(tmp_path / "broken", 0)
    (broken / "rgb" / "000007.png").write_bytes(b"no picture")
    said = farm(broken, *sources[:2], "--out", tmp_path / "out", *FORMAT, "--address", cluster.address, "--", *FLAGS, expect=1)
    assert "2 of 3 recordings" in said and "1 failed for good" in said, said
    assert f"  {broken}: {broken}/associations.txt:8: rgb/000007.png: not a PNG, JPEG, TIFF, WebP, BMP, PNM or GIF file" in said, said
    check(tmp_path / "out", {name: expected[name] for name in ("take0.y4m", "take1.y4m")})


def test_a_stopped_farm_leaves_nothing_behind(cluster, sources, expected, tmp_path):
    out = tmp_path / "out"
    driver = start(out, sources, cluster)
    child = until(lambda: children_at_work(out), "a recording that is being made")[0]
    driver.send_signal(signal.SIGINT)
    _, said = driver.communicate(timeout=60)
    assert driver.returncode == 130 and "the same command does the rest" in said, said
    until(lambda: not is_alive(child), "the end of the program")
    assert os.listdir(out / ".bokehcam-farm") == ["lock"], "parts are left behind"
    for path in out.glob("*.y4m"):
        assert path.read_bytes() == expected[path.name]


@pytest.mark.parametrize(
    ("asked", "answer", "said"),
    [("--version", "echo bokehcam 99", "gets no tasks: "), ("stream", "exit 1", "")],
    ids=["another version", "always fails"],
)
def test_a_node_that_cannot_do_it_costs_no_result(cluster, sources, expected, tmp_path, asked, answer, said):
    program, out = tmp_path / "bokehcam", tmp_path / "out"
    on_last = f'[ "$RAY_RAYLET_PID" = {cluster.raylets[-1]} ] && case "$*" in *{asked}*) {answer}; exit;; esac'
    program.write_text(f'#!/bin/sh\n{on_last}\nexec {PROGRAM} "$@"\n')
    program.chmod(0o755)
    words = farm(*sources[:3], "--out", out, *FORMAT, "--address", cluster.address, "--bokehcam", program, "--", *FLAGS)
    assert "3 of 3 recordings" in words and said in words, words
    check(out, {name: expected[name] for name in ("take0.y4m", "take1.y4m", "take2.y4m")})
