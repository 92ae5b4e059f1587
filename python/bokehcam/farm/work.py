"""Work on a node: runs the program as a child process, and publishes each result exactly once.

Each attempt has its own folder, hidden in the folder of the results and thus on the same file system. The program
writes the result and its report there. The report is then moved to ``reports/``, and last the result gets its name by
``link``, which fails if the name exists: one of several attempts succeeds, and every result has its report. Remains
of a killed attempt stay in its folder, where they cannot be taken for a result.

Uses only the standard library, and nothing else of this package: Ray sends this module to the nodes.
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

# Within the folder of the results: reports, and the farm's private files.
REPORTS = "reports"
HIDDEN = ".bokehcam-farm"
# Folders of attempts (JOB-NUMBER) and settings of jobs (JOB.toml), where JOB is its time of start.
OURS = re.compile(r"([0-9a-f]{16})(-[0-9a-f]{12}|\.toml)")

# What the program adds to a message on several pictures.
OF_MANY = re.compile(r" \(\d+ pictures, the first is .*\)$")

# Execs the program, which dies with its parent (PR_SET_PDEATHSIG, kept by exec) and has the signals blocked that would
# end it early with a seemingly complete result. A separate process, because only a single-threaded process may safely
# run Python between fork and exec.
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
    """One result: its source, its name in the folder, and its own arguments."""

    source: str
    output: str
    extra: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """Settings shared by all units. `command` is ``stream`` or ``render``, `format` an extension, `environment` that of the
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
        """Returns everything that determines the result; threads do not."""
        environment = {name: value for name, value in self.environment.items() if name != "BOKEHCAM_THREADS"}
        given = json.dumps([environment, self.settings], sort_keys=True)
        return {
            "source": unit.source,
            "arguments": [self.command, *self.flags, *unit.extra],
            "settings_sha256": hashlib.sha256(given.encode()).hexdigest(),
        }


@dataclass(frozen=True)
class Result:
    """Outcome of a unit: the number of frames, or the `cause` of the failure. `refused` is true if the program rejected
    its arguments."""

    unit: Unit
    cause: str = ""
    frames: int = 0
    refused: bool = False
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task. `unfit` is the reason why the node did nothing."""

    host: str
    node: str
    results: tuple[Result, ...] = ()
    unfit: str = ""


def perform(job: Job, units: list[Unit], node: str = "") -> Outcome:
    """Makes the results of a task in order; existing ones stay."""
    if not node:
        import ray

        node = ray.get_runtime_context().get_node_id()
    host = socket.gethostname()
    program, unfit = fit(job)
    if unfit:
        return Outcome(host, node, unfit=unfit)
    results = make_pictures(job, units, program) if job.command == "render" else [make(job, unit, program) for unit in units]
    return Outcome(host, node, tuple(results))


def fit(job: Job) -> tuple[str, str]:
    """Returns the program on this node, and the reason if the node is unfit."""
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
    """Returns the absolute path of a program, from its name or path."""
    found = shutil.which(program)
    return os.path.abspath(found) if found else None


def version_of(program: str) -> str:
    """Returns the program's version line; empty if it is not bokehcam."""
    try:
        asked = subprocess.run([program, "--version"], capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=60)
    except (OSError, subprocess.SubprocessError):
        return ""
    said = asked.stdout.strip()
    return said if said.startswith("bokehcam ") else ""


def make(job: Job, unit: Unit, program: str) -> Result:
    """Makes one result, unless it exists."""
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


def make_pictures(job: Job, units: list[Unit], program: str) -> list[Result]:
    """Makes pictures, unless they exist, in one run of the program. Those without a result or an error of their own, as
    after a crash, are made alone."""
    left = [unit for unit in units if not finished(job, unit)]
    made: dict[Unit, Result] = {}
    if len(left) > 1:
        place = job.hidden / f"{job.id}-{secrets.token_hex(6)}"
        try:
            place.mkdir()
            made = attempt_pictures(job, left, program, place)
        except OSError:
            # It concerns each picture, and is reported with each.
            pass
        finally:
            shutil.rmtree(place, ignore_errors=True)
    return [made.get(unit) or make(job, unit, program) for unit in units]


def attempt_pictures(job: Job, units: list[Unit], program: str, place: Path) -> dict[Unit, Result]:
    """Makes pictures in `place` in one run, and publishes them; returns those that are there or have an error."""
    started = time.monotonic()
    _, said = run(job, program, arguments_of_many(job, units, place))
    parts = {unit: part for unit in units if (part := place / unit.output).exists()}
    elapsed_s = (time.monotonic() - started) / max(len(parts), 1)

    def texts(level: str, unit: Unit) -> list[str]:
        words = [in_words(job, place, text) for at, text in said if at == level]
        return [OF_MANY.sub("", text) for text in words if named(text, units) is unit]

    made = {}
    for unit in units:
        warnings = tuple(texts("WARN", unit))
        if part := parts.get(unit):
            made[unit] = settle(job, unit, part, place / "report.json", {"elapsed_s": elapsed_s}, warnings)
        elif errors := texts("ERROR", unit):
            made[unit] = Result(unit, errors[-1], warnings=warnings)
    return made


def named(text: str, units: list[Unit]) -> Unit | None:
    """Returns the unit whose source a message names; the longest name, as one may begin with another."""
    return max((unit for unit in units if unit.source in text), key=lambda unit: len(unit.source), default=None)


def attempt(job: Job, unit: Unit, program: str, place: Path) -> Result:
    """Makes one result in `place`, and publishes it."""
    part, report_part = place / unit.output, place / "report.json"
    started = time.monotonic()
    code, said = run(job, program, arguments(job, unit, part, report_part))
    warnings = tuple(in_words(job, place, text) for level, text in said if level == "WARN")
    if code:
        cause = in_words(job, place, cause_of(code, said))
        return Result(unit, cause, refused=code == 2, warnings=warnings)
    report: Report = read_report(report_part) or {} if job.command == "stream" else {"elapsed_s": time.monotonic() - started}
    return settle(job, unit, part, report_part, report, warnings)


def settle(job: Job, unit: Unit, part: Path, report_part: Path, report: Report, warnings: tuple[str, ...]) -> Result:
    """Publishes the finished result `part` with its report, which is written through the file `report_part`."""
    made = {"output": measure(part), "version": job.version, "host": socket.gethostname()}
    report["farm"] = {**job.asked(unit), **made}
    if not complete(report, job.command):
        return Result(unit, "its report does not account for all frames", warnings=warnings)
    final = job.folder / unit.output
    # An existing report is that of an attempt without a result, or of the winner; then it stays.
    if not os.path.lexists(final):
        put_report(job, unit, report, report_part)
    if publish(part, final):
        # Another attempt may have replaced the report meanwhile.
        if read_report(report_of(job.folder, unit)) != report:
            put_report(job, unit, report, report_part)
    elif not finished(job, unit):
        return Result(unit, f"{final} has appeared meanwhile, and does not belong to this job", warnings=warnings)
    return Result(unit, frames=frames_of(report), warnings=warnings)


def arguments(job: Job, unit: Unit, part: Path, report: Path) -> list[str]:
    """Returns the program's arguments."""
    own = ["--log-format", "json", "--config", str(job.settings_file)]
    common = [*own, job.command, unit.source, *job.flags, *unit.extra]
    if job.command == "render":
        return [*common, "--out", str(part)]
    # In real time, frames may be dropped, and a second run would give another result.
    to = f"{part}/" if job.format == "png" else str(part)
    return [*common, "--to", to, "--report", str(report), "--pace", "asap"]


def arguments_of_many(job: Job, units: list[Unit], place: Path) -> list[str]:
    """Returns the program's arguments for pictures, whose depth maps are in one folder, if they are named."""
    folders = {os.path.dirname(unit.extra[1]) for unit in units if unit.extra}
    maps = [argument for folder in folders for argument in ("--depth-map", folder)]
    own = ["--log-format", "json", "--config", str(job.settings_file), job.command]
    return [*own, *(unit.source for unit in units), *job.flags, *maps, "--out", f"{place}/", "--out-format", job.format]


def run(job: Job, program: str, given: list[str]) -> tuple[int, list[tuple[str, str]]]:
    """Runs the program to its end; returns its exit code and its log as levels and texts."""
    # Ignores the node's settings; without a runtime folder, `bokehcam ctl` for a camera cannot reach it.
    left_out = ("BOKEHCAM_", "RUST_LOG", "XDG_RUNTIME_DIR")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(left_out)}
    child = subprocess.run(
        [sys.executable, "-I", "-S", "-c", PRELUDE, str(os.getpid()), program, *given],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**environment, **job.environment},
        # Relative paths in flags count from here.
        cwd=job.working_folder if job.working_folder.is_dir() else job.folder,
    )
    return child.returncode, [message(line) for line in child.stderr.decode(errors="replace").splitlines() if line.strip()]


def message(line: str) -> tuple[str, str]:
    """Parses a line of the program's log: level and text. Lines of other origin have no level."""
    try:
        said = json.loads(line)
        return said["level"], said["fields"]["message"]
    except (ValueError, KeyError, TypeError):
        return "", line.strip()


def cause_of(code: int, said: list[tuple[str, str]]) -> str:
    """Returns the program's own error message, if any, or its signal or exit code."""
    if code < 0:
        killed = f"the program was killed by signal {-code} ({signal.strsignal(-code)})"
        return f"{killed}; perhaps the node has too little memory" if -code == signal.SIGKILL else killed
    errors = [text for level, text in said if level == "ERROR"] or [text for level, text in said if not level]
    return errors[-1] if errors else f"the program ended with code {code}"


def in_words(job: Job, place: Path, text: str) -> str:
    """Replaces the attempt's folder in a message by that of the results; joins it to one line."""
    return " ".join(text.replace(str(place), str(job.folder)).split())


def publish(part: Path, final: Path) -> bool:
    """Publishes a result under its name, unless that exists; returns whether it did."""
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
        # A network file system may repeat a completed request whose answer was lost.
        return os.stat(part).st_nlink == 2
    return True


def put_report(job: Job, unit: Unit, report: Report, part: Path) -> None:
    """Writes a report atomically, through the file `part`."""
    with open(part, "w", encoding="utf-8") as file:
        json.dump(report, file, indent=2)
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, report_of(job.folder, unit))
    sync(job.folder / REPORTS)


def sync(folder: Path) -> None:
    """Flushes a folder's entries to disk."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


def report_of(folder: Path, unit: Unit) -> Path:
    """Returns the path of a result's report."""
    return folder / REPORTS / f"{unit.output}.json"


def read_report(path: Path) -> Report | None:
    """Reads a report; returns `None` without a file, and an empty one for other contents."""
    try:
        report = json.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValueError):
        return {}
    return report if isinstance(report, dict) else {}


def complete(report: Report, command: str) -> bool:
    """Whether a farm completed the report, and it accounts for every frame."""
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
    """Returns the number of frames of a result; 1 for a picture."""
    return int(report["frames"]["delivered"]) if "frames" in report else 1


def measure(output: Path) -> dict[str, int]:
    """Returns the size of a result: a file's bytes, or the number of files in a folder."""
    if output.is_dir():
        return {"files": len(os.listdir(output))}
    return {"bytes": output.stat().st_size}


def finished(job: Job, unit: Unit) -> Report | None:
    """Returns the report of a finished result, made from the same source by the same flags and settings."""
    report = read_report(report_of(job.folder, unit))
    if not report or not complete(report, job.command):
        return None
    try:
        expected = {**job.asked(unit), "output": measure(job.folder / unit.output)}
    except OSError:
        return None
    return report if expected.items() <= report["farm"].items() else None
