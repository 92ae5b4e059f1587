"""Planning of a job: its units, and which are finished; all errors are found before anything starts."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from .work import HIDDEN, OURS, REPORTS, Job, Unit, finished, located, read_report, report_of, version_of

PICTURES = (".png", ".jpg", ".jpeg")
DEPTH_MAPS = (".png", ".pfm")
# The program's names for the depth map next to a photo, which it finds itself.
DEPTH_SUFFIXES = ("-depth", ".depth")
MASK_SUFFIXES = ("-mask", ".mask")
# Formats that each command can write; the first is the default.
FORMATS = {"stream": ("mp4", "mkv", "webm", "y4m", "png"), "render": ("png", "jpg")}
# Flags of the program that the farm sets itself, or that make no sense with it.
OWN_FLAGS = {
    "stream": (
        "--to",
        "--report",
        "--name",
        "--pace",
        "--force",
        "--on-demand",
        "--out-size",
        "--config",
        "--log-format",
    ),
    "render": ("--out", "--out-format", "--depth-map", "--mask", "--like", "--force", "--config", "--log-format"),
}
MAX_NAME_BYTES = 255


class UsageError(Exception):
    """The arguments are wrong."""


class FarmError(Exception):
    """Something is missing, or another farm is at work."""


def program_at(given: str) -> tuple[str, str]:
    """Returns the program for the nodes, and its version. Each node looks up a name without a folder in its path."""
    found = located(given)
    if not found:
        raise FarmError(f"there is no program {given}: install bokehcam, or give its file with --bokehcam or BOKEHCAM")
    version = version_of(found)
    if not version:
        raise FarmError(f"{found} is not bokehcam: give its file with --bokehcam or BOKEHCAM")
    return (found if "/" in given else given), version


def split_flags(rest: list[str]) -> tuple[str, tuple[str, ...]]:
    """Splits the arguments into the program's command and its flags."""
    command = "stream"
    if rest and not rest[0].startswith("-"):
        command, rest = rest[0], rest[1:]
    if command not in FORMATS:
        raise UsageError(f"{command}: after -- come `stream` or `render` and their flags")
    names = [flag.split("=", 1)[0] for flag in rest]
    for name in names:
        if name in OWN_FLAGS[command]:
            raise UsageError(f"{name}: the farm sets this itself; leave it out")
    if "--loop" in names and "--frames" not in names:
        raise UsageError("--loop: it would never end; add --frames N")
    return command, tuple(rest)


def refuse_bad_flags(program: str, command: str, flags: tuple[str, ...]) -> None:
    """Lets the program parse its flags without running."""
    needed = ["demo", "--to", "null"] if command == "stream" else ["a.png", "--out", "b.png"]
    asked = subprocess.run(
        [located(program) or program, command, *needed, *flags, "--help"],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    if asked.returncode:
        said = " ".join(asked.stderr.split())
        raise UsageError(f"bokehcam {command} does not take these flags: {said.removeprefix('error: ')}")


def settings() -> tuple[dict[str, str], str]:
    """Returns the program's settings on this machine for all nodes: from the environment, and the settings file's text."""
    environment = {name: value for name, value in os.environ.items() if name.startswith("BOKEHCAM_")}
    given = environment.pop("BOKEHCAM_CONFIG", None)
    folder = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    file = Path(given) if given else folder / "bokehcam" / "config.toml"
    if not given and not file.exists():
        return environment, ""
    try:
        return environment, file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise UsageError(f"the settings file {file}: {error}") from error


def with_defaults(environment: dict[str, str], text: str, cpus: int, gpus: float) -> dict[str, str]:
    """Adds settings for tasks that share a node, unless the environment or the file (`text`) sets them. A task without a
    GPU uses none: results are the same to the bit on all nodes."""
    defaults = {"threads": str(cpus), "backend": "gpu" if gpus else "cpu"}
    free = {name: value for name, value in defaults.items() if not re.search(rf"(?m)^\s*{name}\s*=", text)}
    return {**{f"BOKEHCAM_{name.upper()}": value for name, value in free.items()}, **environment}


def units(command: str, sources: Iterable[str], extension: str, depth_maps: str | None) -> list[Unit]:
    """Returns the units in the order of the sources, each with a unique name."""
    paths = [path for source in sources for path in expanded(command, Path(source))]
    if not paths:
        raise UsageError("there are no sources")
    made: dict[str, Path] = {}
    planned = []
    for path in paths:
        stem = path.stem if command == "render" or path.is_file() else path.name
        output = stem if (command, extension) == ("stream", "png") else f"{stem}.{extension}"
        other = made.setdefault(output, path)
        if other is not path:
            raise UsageError(
                f"{other} and {path}: the result of both would be {output}; give them to two farms with an --out each"
            )
        if output in (REPORTS, HIDDEN) or len(os.fsencode(f"{output}.json")) > MAX_NAME_BYTES:
            raise UsageError(f"{path}: its result cannot be called {output}; give the source another name")
        planned.append(Unit(str(path), output, depth_of(path, depth_maps) if command == "render" else ()))
    return planned


def expanded(command: str, source: Path) -> list[Path]:
    """Returns a recording, a picture, or the pictures of a folder."""
    path = Path(os.path.abspath(source))
    if not path.exists():
        raise UsageError(f"{source}: there is no such file or folder")
    if command == "stream":
        return [path]
    if not path.is_dir():
        if path.suffix.lower() not in PICTURES:
            raise UsageError(f"{source}: not a PNG or JPEG; recordings are for `stream`")
        return [path]
    entries = sorted(path.iterdir())
    stems = {entry.stem for entry in entries}

    def is_companion(stem: str) -> bool:
        """Whether it is a depth map, or the mask of a picture that is there: the program leaves these out, too."""
        is_mask = any(stem.endswith(end) and stem.removesuffix(end) in stems for end in MASK_SUFFIXES)
        return is_mask or stem.endswith(DEPTH_SUFFIXES)

    pictures = [
        entry
        for entry in entries
        if entry.suffix.lower() in PICTURES
        and not entry.name.startswith(".")
        and not is_companion(entry.stem)
    ]
    if not pictures:
        raise UsageError(f"{source}: it contains no pictures (PNG or JPEG); recordings are for `stream`")
    return pictures


def depth_of(picture: Path, folder: str | None) -> tuple[str, ...]:
    """Returns the arguments for a picture's depth map: the one of its name in `folder`, if there is a folder."""
    if folder is None:
        return ()
    # As the program finds it there.
    names = [[f"{picture.stem}{suffix}{end}" for end in DEPTH_MAPS] for suffix in (*DEPTH_SUFFIXES, "")]
    there = [[path for name in same if (path := Path(os.path.abspath(folder)) / name).exists()] for same in names]
    found = next((paths for paths in there if paths), [])
    if not found:
        raise UsageError(f"{picture}: its depth map {picture.stem}.png or .pfm is not in {folder}")
    if len(found) > 1:
        raise UsageError(f"{picture}: {found[0]} and {found[1]} are both its depth map: remove one")
    return "--depth-map", str(found[0])


def to_do(job: Job, planned: list[Unit]) -> list[Unit]:
    """Returns the unfinished units. Foreign files in place of a result are kept, and are an error."""
    return [unit for unit in planned if not finished(job, unit) and may_be_made(job, unit)]


def may_be_made(job: Job, unit: Unit) -> bool:
    final, report = job.folder / unit.output, read_report(report_of(job.folder, unit))
    ours = (report or {}).get("farm")
    if report is not None and not isinstance(ours, dict):
        raise UsageError(f"{report_of(job.folder, unit)} is not a report of a farm, and is not replaced: choose another --out")
    if not os.path.lexists(final):
        return True
    if not ours:
        raise UsageError(f"{final} exists without a report of a farm, and is not replaced: move it away, or choose another --out")
    asked = job.asked(unit)
    if ours.get("source") != asked["source"]:
        raise UsageError(f"{final} exists, and was made of {ours.get('source')}: choose another --out")
    if ours.get("arguments") != asked["arguments"]:
        flags = " ".join(map(str, ours.get("arguments") or []))
        raise UsageError(f"{final} exists, and was made by `{flags}`: choose another --out, or give these flags again")
    if ours.get("settings_sha256") != asked["settings_sha256"]:
        raise UsageError(f"{final} exists, and was made with other settings (file or environment): choose another --out")
    raise UsageError(f"{final} or its report has changed since a farm made it: move it away, or choose another --out")


@contextmanager
def at_work(job: Job) -> Iterator[None]:
    """Prepares the folder for a job, locks it against other farms, and leaves only the lock hidden in it."""
    try:
        for folder in (job.folder, job.folder / REPORTS, job.hidden):
            folder.mkdir(parents=True, exist_ok=True)
        with open(job.hidden / "lock", "a", encoding="utf-8") as lock:
            take(lock, job)
            sweep(job.hidden, lambda of: of < job.id)
            try:
                job.settings_file.write_text(job.settings, encoding="utf-8")
                try_link(job)
                yield
            finally:
                sweep(job.hidden, lambda of: of == job.id)
    except OSError as error:
        raise FarmError(str(error)) from error


def take(lock: IO[str], job: Job) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise FarmError(f"another farm is at work in {job.folder}: wait for it, or choose another --out") from error
    except OSError as error:
        print(f"warning: {job.folder} cannot be locked ({error}): do not start another farm on it meanwhile", file=sys.stderr)


def try_link(job: Job) -> None:
    """Checks for hard links, by which results are published."""
    link = job.hidden / f"{job.id}-{0:012x}"
    try:
        os.link(job.settings_file, link)
        os.unlink(link)
    except OSError as error:
        raise FarmError(f"{job.folder}: its file system has no hard links ({error}); choose another --out") from error


def sweep(hidden: Path, of_job: Callable[[str], bool]) -> None:
    """Removes leftovers of the jobs that `of_job` selects: killed attempts, and settings."""
    for entry in os.scandir(hidden):
        ours = OURS.fullmatch(entry.name)
        if ours and of_job(ours[1]):
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            else:
                Path(entry.path).unlink(missing_ok=True)


def new_id() -> str:
    """Returns a job id from the start time, so that ids sort by age."""
    return f"{time.time_ns():016x}"
