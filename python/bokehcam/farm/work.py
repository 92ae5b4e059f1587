"""What runs on a node: the program as a child, and each of its results exactly once.

An attempt has a folder of its own, hidden within the folder of the results and thus on the same file system. There the
program writes the result and its report. The report then gets its place in ``reports/``, and last the result gets its
name by ``link``, which fails where that is taken: of several attempts at one thing one succeeds, and a result that is
there has its report. What is left of an attempt that was killed is in its folder, where nobody takes it for a result.

Nothing but the standard library is used, and nothing else of this package: Ray brings this module to the nodes.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Report = dict[str, Any]

# Within the folder of the results: their reports, and what is ours alone.
REPORTS = "reports"
HIDDEN = ".bokehcam-farm"
# Folders of attempts (JOB-NUMBER) and settings of jobs (JOB.toml), where JOB is its time of start.
OURS = re.compile(r"([0-9a-f]{16})(-[0-9a-f]{12}|\.toml)")

# Replaces itself by the program, which then dies with its parent (PR_SET_PDEATHSIG, kept by exec) and is deaf to signals
# that would make it end early and call that a whole result. In a process of its own, because between fork and exec
# only a process of one thread may run Python safely.
PRELUDE = """
import ctypes, os, signal, sys
parent, program = int(sys.argv[1]), sys.argv[2]
ctypes.CDLL(None).prctl(1, signal.SIGKILL)
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT, signal.SIGHUP})
if os.getppid() != parent:
    os.kill(os.getpid(), signal.SIGKILL)
os.execv(program, sys.argv[2:])
"""


@dataclass(frozen=True)
class Unit:
    """One result: what it is made of, its name in the folder, and arguments that it alone has."""

    source: str
    output: str
    extra: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """What all results have in common. `command` is ``stream`` or ``render``, `format` an extension, `environment` that of the
    program's settings."""

    id: str
    folder: Path
    command: str
    format: str
    flags: tuple[str, ...]
    environment: dict[str, str]
    settings: str
    program: str
    version: str
    working_folder: Path

    @property
    def hidden(self) -> Path:
        return self.folder / HIDDEN

    @property
    def settings_file(self) -> Path:
        return self.hidden / f"{self.id}.toml"

    def asked(self, unit: Unit) -> dict[str, Any]:
        """All that decides what the result looks like. Threads do not."""
        environment = {name: value for name, value in self.environment.items() if name != "BOKEHCAM_THREADS"}
        given = json.dumps([environment, self.settings], sort_keys=True)
        return {
            "source": unit.source,
            "arguments": [self.command, *self.flags, *unit.extra],
            "settings_sha256": hashlib.sha256(given.encode()).hexdigest(),
        }


@dataclass(frozen=True)
class Result:
    """What became of a unit: the frames that are in its result, or the `cause` why there is none. `refused` says that the
    program called its arguments wrong."""

    unit: Unit
    cause: str = ""
    frames: int = 0
    refused: bool = False
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What became of a task. A node that is `unfit`, and why, did nothing."""

    host: str
    node: str
    results: tuple[Result, ...] = ()
    unfit: str = ""


def perform(job: Job, units: list[Unit], node: str = "") -> Outcome:
    """Makes the results of a task, one after the other; those that are there stay."""
    if not node:
        import ray

        node = ray.get_runtime_context().get_node_id()
    host = socket.gethostname()
    program, unfit = fit(job)
    if unfit:
        return Outcome(host, node, unfit=unfit)
    return Outcome(host, node, tuple(make(job, unit, program) for unit in units))


def fit(job: Job) -> tuple[str, str]:
    """The program on this node, and why nothing can be made here."""
    if not job.settings_file.exists():
        return "", f"{job.folder} is not there, or is another folder: is the shared storage mounted?"
    program = located(job.program)
    if not program:
        return "", f"there is no program {job.program}"
    version = version_of(program)
    if version != job.version:
        return "", f"{program} is {version or 'no bokehcam'}, where the job was started with {job.version}"
    return program, ""


def located(program: str) -> str | None:
    """The whole path of a program that is named, or by its path."""
    found = shutil.which(program)
    return os.path.abspath(found) if found else None


def version_of(program: str) -> str:
    """What it says of itself; nothing where it is none."""
    try:
        asked = subprocess.run([program, "--version"], capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=60)
    except (OSError, subprocess.SubprocessError):
        return ""
    said = asked.stdout.strip()
    return said if said.startswith("bokehcam ") else ""


def make(job: Job, unit: Unit, program: str) -> Result:
    """Makes one result, unless it is there."""
    if report := finished(job, unit):
        return Result(unit, frames=frames_of(report))
    place = job.hidden / f"{job.id}-{secrets.token_hex(6)}"
    try:
        place.mkdir()
        return attempt(job, unit, program, place)
    except OSError as error:
        return Result(unit, in_words(job, place, str(error)))
    finally:
        shutil.rmtree(place, ignore_errors=True)


def attempt(job: Job, unit: Unit, program: str, place: Path) -> Result:
    """Makes one result in `place`, and gives it its name."""
    part, report_part = place / unit.output, place / "report.json"
    started = time.monotonic()
    code, said = run(job, program, arguments(job, unit, part, report_part))
    warnings = tuple(in_words(job, place, text) for level, text in said if level == "WARN")
    if code:
        cause = in_words(job, place, cause_of(code, said))
        return Result(unit, cause, refused=code == 2, warnings=warnings)
    report: Report = read_report(report_part) or {} if job.command == "stream" else {"elapsed_s": time.monotonic() - started}
    made = {"output": measure(part), "version": job.version, "host": socket.gethostname()}
    report["farm"] = {**job.asked(unit), **made}
    if not complete(report, job.command):
        return Result(unit, "its report does not account for all frames", warnings=warnings)
    final = job.folder / unit.output
    # A report that is there is that of an attempt which did not come further, or of the one that is first; then it stays.
    if not os.path.lexists(final):
        put_report(job, unit, report, report_part)
    if publish(part, final):
        # Another attempt may have put its own there meanwhile.
        if read_report(report_of(job.folder, unit)) != report:
            put_report(job, unit, report, report_part)
    elif not finished(job, unit):
        return Result(unit, f"{final} has appeared meanwhile, and is not of this job", warnings=warnings)
    return Result(unit, frames=frames_of(report), warnings=warnings)


def arguments(job: Job, unit: Unit, part: Path, report: Path) -> list[str]:
    """The program's arguments."""
    own = ["--log-format", "json", "--config", str(job.settings_file)]
    common = [*own, job.command, unit.source, *job.flags, *unit.extra]
    if job.command == "render":
        return [*common, "--out", str(part)]
    # In real time frames may be dropped, and a second run would give another result.
    to = f"{part}/" if job.format == "png" else str(part)
    return [*common, "--to", to, "--report", str(report), "--pace", "asap"]


def run(job: Job, program: str, given: list[str]) -> tuple[int, list[tuple[str, str]]]:
    """Runs the program to its end; its exit code, and what it said: levels and texts."""
    # Settings of the node do not count, and without a runtime folder no `bokehcam ctl` that is meant for a camera finds it.
    left_out = ("BOKEHCAM_", "RUST_LOG", "XDG_RUNTIME_DIR")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(left_out)}
    child = subprocess.run(
        [sys.executable, "-I", "-S", "-c", PRELUDE, str(os.getpid()), program, *given],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**environment, **job.environment},
        # Where the files lie that flags name without a whole path.
        cwd=job.working_folder if job.working_folder.is_dir() else job.folder,
    )
    return child.returncode, [message(line) for line in child.stderr.decode(errors="replace").splitlines() if line.strip()]


def message(line: str) -> tuple[str, str]:
    """A line of the program's log: level and text. What others wrote there has no level."""
    try:
        said = json.loads(line)
        return said["level"], said["fields"]["message"]
    except (ValueError, KeyError, TypeError):
        return "", line.strip()


def cause_of(code: int, said: list[tuple[str, str]]) -> str:
    """Why the program failed, in its own words where it had any."""
    if code < 0:
        killed = f"the program was killed by signal {-code} ({signal.strsignal(-code)})"
        return f"{killed}; perhaps the node has too little memory" if -code == signal.SIGKILL else killed
    errors = [text for level, text in said if level == "ERROR"] or [text for level, text in said if not level]
    return errors[-1] if errors else f"the program ended with code {code}"


def in_words(job: Job, place: Path, text: str) -> str:
    """A message of an attempt, as if it had worked on the result itself; in one line."""
    return " ".join(text.replace(str(place), str(job.folder)).split())


def publish(part: Path, final: Path) -> bool:
    """Gives a result its name, unless that is taken; whether it has it."""
    if part.is_dir():
        try:
            os.rename(part, final)
        except OSError as error:
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                return False
            raise
        return True
    try:
        os.link(part, final)
    except FileExistsError:
        # A network file system may repeat what it has done already, when the answer was lost.
        return os.stat(part).st_nlink == 2
    return True


def put_report(job: Job, unit: Unit, report: Report, part: Path) -> None:
    """Gives a report its place, by way of the file `part`."""
    with open(part, "w", encoding="utf-8") as file:
        json.dump(report, file, indent=2)
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, report_of(job.folder, unit))
    sync(job.folder / REPORTS)


def sync(folder: Path) -> None:
    """Waits until the names in a folder are on the disk."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


def report_of(folder: Path, unit: Unit) -> Path:
    """Where the report of a result is."""
    return folder / REPORTS / f"{unit.output}.json"


def read_report(path: Path) -> Report | None:
    """A report; `None` where there is no file, and an empty one where it holds something else."""
    try:
        report = json.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValueError):
        return {}
    return report if isinstance(report, dict) else {}


def complete(report: Report, command: str) -> bool:
    """Whether a report was written to its end by a farm, and knows of every frame what became of it."""
    if not isinstance(report.get("farm"), dict):
        return False
    if command == "render":
        return True
    try:
        frames = report["frames"]
        known = frames["delivered"] + sum(frames["dropped"].values())
        return bool(frames["in_flight"] == 0 and frames["captured"] == known and frames["delivered"] > 0)
    except (KeyError, TypeError, AttributeError):
        return False


def frames_of(report: Report) -> int:
    """The frames of a result; a picture is one."""
    return int(report["frames"]["delivered"]) if "frames" in report else 1


def measure(output: Path) -> dict[str, int]:
    """How large a result is: a file's bytes, or the number of files in a folder."""
    if output.is_dir():
        return {"files": len(os.listdir(output))}
    return {"bytes": output.stat().st_size}


def finished(job: Job, unit: Unit) -> Report | None:
    """The whole report of a result that is there, and was made of the same source by the same flags and settings."""
    report = read_report(report_of(job.folder, unit))
    if not report or not complete(report, job.command):
        return None
    try:
        expected = {**job.asked(unit), "output": measure(job.folder / unit.output)}
    except OSError:
        return None
    return report if expected.items() <= report["farm"].items() else None
