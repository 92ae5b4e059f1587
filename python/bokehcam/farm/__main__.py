"""``python -m bokehcam.farm``: arguments in, exit code out: 0, 1 where something failed, 2 where the arguments are wrong."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from . import plan
from .plan import FarmError, UsageError
from .work import Job, Unit

if TYPE_CHECKING:
    from .drive import Tally

EXAMPLES = """examples:
  python -m bokehcam.farm recordings/* --out out -- --aperture polygon:6 --quality best
  python -m bokehcam.farm recordings/* --out out --format y4m --address auto --cpus 4
  python -m bokehcam.farm photos --depth-maps depths --out out -- render --focus 0.5,0.4
  find /data -name rgb.txt -printf '%h\\n' | python -m bokehcam.farm --list - --out out
"""


class Parser(argparse.ArgumentParser):
    """Reports errors in one line, like the program."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(message)


def parser() -> Parser:
    parser = Parser(
        prog="python -m bokehcam.farm",
        usage="python -m bokehcam.farm [options] SOURCE... --out DIR [-- [stream|render] FLAGS]",
        description="Blur many recordings (stream) or still pictures (render) on the machines of a Ray cluster, each once. "
        "If started again, it completes the rest.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "sources", nargs="*", metavar="SOURCE", help="stream: a recording; render: a picture or a folder of them"
    )
    parser.add_argument(
        "--out",
        required=True,
        metavar="DIR",
        help="folder for results and their reports (DIR/reports), which all nodes can access",
    )
    parser.add_argument("--list", metavar="FILE", help="file with more sources, one per line; - is standard input")
    parser.add_argument(
        "--format",
        metavar="EXT",
        help="stream: mp4 (default), mkv, webm, y4m or png (folders); render: png (default) or jpg",
    )
    parser.add_argument(
        "--depth-maps",
        metavar="DIR",
        help="render: folder of depth maps, named like the pictures [default: NAME-depth beside them]",
    )
    parser.add_argument(
        "--address",
        metavar="ADDR",
        help="Ray cluster: auto, HOST:PORT, or local [default: a running one, else local]",
    )
    parser.add_argument("--cpus", type=number(int, 1), default=1, metavar="N", help="CPUs and threads per task [default: 1]")
    parser.add_argument(
        "--gpus", type=number(float, 0), default=0.0, metavar="N", help="GPUs per task, for the blur [default: 0]"
    )
    parser.add_argument(
        "--shard", type=number(int, 1), default=32, metavar="N", help="render: pictures per task [default: 32]"
    )
    parser.add_argument(
        "--retries",
        type=number(int, 0),
        default=3,
        metavar="N",
        help="number of retries of a failed task [default: 3]",
    )
    parser.add_argument(
        "--bokehcam", metavar="FILE", help="the program, at the same place on all nodes [default: BOKEHCAM, else from their path]"
    )
    return parser


def number(kind: Callable[[str], float], least: float) -> Callable[[str], float]:
    """Returns a parser of numbers with the minimum `least`."""

    def parse(text: str) -> float:
        value = kind(text)
        if value < least:
            raise argparse.ArgumentTypeError(f"{text}: at least {least}")
        return value

    parse.__name__ = "number"
    return parse


def sources_of(given: argparse.Namespace) -> list[str]:
    """Returns the sources of the arguments and of the list."""
    if given.list is None:
        return list(given.sources)
    try:
        text = sys.stdin.read() if given.list == "-" else Path(given.list).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise UsageError(f"--list {given.list}: {error}") from error
    return [*given.sources] + [line for line in text.splitlines() if line.strip()]


def plan_job(given: argparse.Namespace, rest: list[str]) -> tuple[Job, list[Unit], list[Unit]]:
    """Returns the job, all of its units, and the unfinished ones."""
    command, flags = plan.split_flags(rest)
    formats = plan.FORMATS[command]
    extension = given.format or formats[0]
    if extension not in formats:
        raise UsageError(f"--format {extension}: {command} writes {', '.join(formats)}")
    if given.depth_maps is not None and command != "render":
        raise UsageError("--depth-maps is for `render`: recordings have their depth")
    program, version = plan.program_at(given.bokehcam or os.environ.get("BOKEHCAM") or "bokehcam")
    plan.refuse_bad_flags(program, command, flags)
    environment, settings = plan.settings()
    job = Job(
        id=plan.new_id(),
        folder=Path(os.path.abspath(given.out)),
        command=command,
        format=extension,
        flags=flags,
        environment=plan.with_defaults(environment, settings, given.cpus, given.gpus),
        settings=settings,
        program=program,
        version=version,
        working_folder=Path.cwd(),
    )
    units = plan.units(command, sources_of(given), extension, given.depth_maps)
    return job, units, plan.to_do(job, units)


def run(arguments: list[str]) -> int:
    """Runs a farm and returns the exit code.

    Raises:
        UsageError: the arguments are wrong.
        FarmError: it cannot run.
    """
    end = arguments.index("--") if "--" in arguments else len(arguments)
    given, rest = parser().parse_intermixed_args(arguments[:end]), arguments[end + 1 :]
    job, units, left = plan_job(given, rest)
    noun = "recordings" if job.command == "stream" else "pictures"
    if not left:
        say(f"{len(units)} of {len(units)} {noun} are in {given.out}, as they were")
        return 0
    try:
        from . import drive
    except ImportError as error:
        raise FarmError(f"{error}: pip install 'bokehcam[ray]'") from error
    options = drive.Options(given.address, given.cpus, given.gpus, given.shard, given.retries)
    with plan.at_work(job):
        drive.connect(options)
        # Replaces Ray's handler.
        signal.signal(signal.SIGTERM, stop)
        try:
            farm = drive.Farm(job, options)
            tally = farm.run(left)
        finally:
            drive.leave()
    return summarise(tally, len(units), len(units) - len(left), noun, given.out)


def stop(_signal: int, _frame: FrameType | None) -> NoReturn:
    """Ends the farm like Ctrl-C."""
    raise KeyboardInterrupt


def summarise(tally: Tally, all_units: int, there_before: int, noun: str, out: str) -> int:
    """Prints the results and returns the exit code."""
    for text, (source, times) in tally.warnings.items():
        if times > 1:
            say(f"warning, of {times} {noun}, such as {source}: {text}")
    made = f"{tally.made} made now ({tally.rate()}), {there_before} before"
    say(f"{there_before + tally.made} of {all_units} {noun} are in {out}: {made}")
    if tally.ended:
        say(f"error: {tally.ended}")
        return 2 if tally.refused else 1
    if tally.failed:
        say(f"error: {len(tally.failed)} failed for good:")
        for result in tally.failed.values():
            say(f"  {result.unit.source}: {result.cause}")
    return 1 if tally.failed else 0


def say(line: str) -> None:
    print(line, file=sys.stderr)


def main() -> int:
    try:
        return run(sys.argv[1:])
    except UsageError as error:
        say(f"error: {error}")
        return 2
    except FarmError as error:
        say(f"error: {error}")
        return 1
    except KeyboardInterrupt:
        say("stopped: what was finished stays; the same command does the rest")
        return 128 + signal.SIGINT


if __name__ == "__main__":
    sys.exit(main())
