"""Fixtures of the farm's tests: the program, different recordings, and a cluster of two nodes with one core each."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import bokehcam
import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PORTRAIT = REPOSITORY / "recordings" / "portrait"
# With autofocus and background memory, each frame depends on the previous ones.
FRAMES = 36
FLAGS = ["--loop", "--frames", str(FRAMES), "--quality", "draft"]
FORMAT = ["--format", "y4m"]
TIMEOUT_S = 60.0
TOKEN = secrets.token_hex(32)


def program() -> Path | None:
    """The program: as python/test names it, else BOKEHCAM, else what was built last here, else that in the path."""
    if given := os.environ.get("BOKEHCAM_PROGRAM") or os.environ.get("BOKEHCAM"):
        return Path(given)
    built = [path for path in REPOSITORY.glob("target/*/bokehcam") if path.is_file() and os.access(path, os.X_OK)]
    newest = max(built, key=lambda path: path.stat().st_mtime, default=None)
    found = newest or shutil.which("bokehcam")
    return Path(found) if found else None


PROGRAM = program()
needs_program = pytest.mark.skipif(PROGRAM is None, reason="needs the program: build it, or name it by BOKEHCAM")
has_ray = importlib.util.find_spec("ray") is not None and importlib.util.find_spec("tqdm") is not None
needs_ray = pytest.mark.skipif(not has_ray, reason="needs Ray and tqdm: pip install 'bokehcam[ray]'")


def recording(folder: Path, first: int) -> Path:
    """A recording of 24 frames that begins with frame `first` of the bundled one, and so has bytes of its own."""
    folder.mkdir(parents=True)
    for kind in ("rgb", "depth"):
        shutil.copytree(PORTRAIT / kind, folder / kind)
    line = "{0:.6f} rgb/{1:06}.png {0:.6f} depth/{1:06}.png\n"
    (folder / "associations.txt").write_text("".join(line.format(k / 12, (first + k) % 24) for k in range(24)))
    return folder


def environment() -> dict[str, str]:
    """Returns the environment of the tests, without the user's settings."""
    others = {name: value for name, value in os.environ.items() if not name.startswith(("BOKEHCAM", "RAY_"))}
    return {
        **others,
        "BOKEHCAM": str(PROGRAM),
        "PYTHONPATH": str(Path(bokehcam.__file__).parents[1]),
        "XDG_CONFIG_HOME": "/nonexistent",
        # Only these tests may join their clusters, and Ray creates no token in the user's home.
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN": TOKEN,
    }


def farm_command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "bokehcam.farm", *map(str, arguments)]


def farm(*arguments: str | Path, expect: int = 0, **changes: str) -> str:
    """Runs a farm to its end; returns its messages."""
    run = subprocess.run(
        farm_command(*arguments),
        env={**environment(), **changes},
        capture_output=True,
        text=True,
        timeout=180,
        stdin=subprocess.DEVNULL,
    )
    assert run.returncode == expect, f"{run.returncode}: {run.stderr}"
    assert "Traceback" not in run.stderr, run.stderr
    return run.stderr


def alone(source: Path, out: Path, flags: list[str], threads: int = 2) -> bytes:
    """Returns the program's result of a recording without a farm."""
    command = [
        str(PROGRAM),
        "-q",
        "stream",
        str(source),
        "--to",
        str(out),
        "--threads",
        str(threads),
        "--backend",
        "cpu",
        *flags,
    ]
    subprocess.run(command, check=True, env=environment(), stdin=subprocess.DEVNULL, timeout=120)
    return out.read_bytes()


def until(condition: Callable[[], object], what: str):
    """Waits for a true value, and returns it."""
    for _ in range(int(TIMEOUT_S / 0.02)):
        if found := condition():
            return found
        time.sleep(0.02)
    raise AssertionError(f"not within {TIMEOUT_S:.0f} s: {what}")


def parent_of(process: int) -> int:
    """Returns the parent of a process; 0 if it has ended."""
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except (OSError, IndexError):
        return 0


def is_alive(process: int) -> bool:
    """Whether a process runs; zombies do not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    except OSError:
        return False


def children_at_work(out: Path) -> list[int]:
    """Finds processes of the program that are writing a file for the folder `out`."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            command = (entry / "cmdline").read_bytes().split(b"\0") if entry.name.isdigit() else []
        except OSError:
            continue
        to = command[command.index(b"--to") + 1] if b"--to" in command else b""
        # Before that, the process has not executed the program yet.
        if to.startswith(os.fsencode(out)) and command[0] == os.fsencode(PROGRAM) and parts(Path(os.fsdecode(to))):
            found.append(int(entry.name))
    return found


def parts(path: Path) -> bool:
    """Whether the file at `path` is being written, and has frames."""
    try:
        return any(part.stat().st_size > 100_000 for part in path.parent.glob(f".{path.name}.*"))
    except OSError:
        return False


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Cluster:
    """Ray on this machine, of nodes with one core each, which are processes that can be killed."""

    def __init__(self):
        # A short path, for sockets.
        self.folder = tempfile.mkdtemp(prefix="farm-", dir="/tmp")
        self.address = f"127.0.0.1:{free_port()}"
        self.nodes: list[subprocess.Popen] = []
        head = [
            "--head",
            f"--port={self.address.rsplit(':', 1)[1]}",
            "--include-dashboard=false",
            f"--temp-dir={self.folder}",
        ]
        self.raylets: list[int] = []
        self.start(*head)

    def start(self, *arguments: str) -> None:
        """Starts a node, and waits for it."""
        common = ["--num-cpus=1", "--object-store-memory=100000000", "--disable-usage-stats", "--block"]
        ray = str(Path(sys.executable).with_name("ray"))
        log = open(f"{self.folder}/node{len(self.nodes)}.log", "wb")
        node = subprocess.Popen(
            [ray, "start", *arguments, *common], stdout=log, stderr=log, stdin=subprocess.DEVNULL, env=environment()
        )
        self.nodes.append(node)
        said = Path(log.name)
        until(lambda: b"Ray runtime started" in said.read_bytes() or node.poll() is not None, "a node of Ray's")
        assert node.poll() is None, said.read_text()
        self.raylets.append(until(lambda: self.raylet_of(node.pid), "its raylet"))

    def add(self) -> None:
        """Starts another node."""
        self.start(f"--address={self.address}")

    @staticmethod
    def raylet_of(node: int) -> int:
        """Returns the process of a node that starts workers."""
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and parent_of(int(entry.name)) == node:
                try:
                    if (entry / "comm").read_text().strip() == "raylet":
                        return int(entry.name)
                except OSError:
                    continue
        return 0

    def kill_last(self) -> None:
        """Kills the last node, as a power failure would."""
        os.kill(self.raylets[-1], signal.SIGKILL)

    def stop(self) -> None:
        """Ends all processes of all nodes."""
        for node in reversed(self.nodes):
            for process in [node.pid, *descendants(node.pid)]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            node.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def descendants(process: int) -> list[int]:
    """Returns all descendants of a process."""
    children = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    children = [child for child in children if parent_of(child) == process]
    return children + [deeper for child in children for deeper in descendants(child)]
