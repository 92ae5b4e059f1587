"""Tasks on a Ray cluster: handed out, tried again where they failed, and accounted for.

Ray is not asked to try again: here it is known which results of a task are there, and why others are not.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import ray
from ray import cloudpickle
from tqdm import tqdm

from . import work
from .plan import FarmError
from .work import Job, Outcome, Result, Unit, finished, frames_of

# Where the program calls its arguments wrong for so many sources, before any result, it is not for the sources.
REFUSED_AT_MOST = 3
# So many tasks at least wait for a free place on the nodes, else as many as run.
LEAST_WAITING = 8
LOOK_S = 5.0


@dataclass(frozen=True)
class Options:
    """How tasks are run: what each takes of a node, and how often one that failed is tried again."""

    address: str | None
    cpus: int
    gpus: float
    shard: int
    retries: int


@dataclass
class Task:
    """Results that are made together, how often that failed, and what the program said of the one that is tried again."""

    units: list[Unit]
    failed: int = 0
    cause: str = ""
    # The node where that was.
    avoid: str = ""


@dataclass
class Tally:
    """What became of all."""

    made: int = 0
    frames: int = 0
    elapsed_s: float = 0.0
    nodes: set[str] = field(default_factory=set)
    failed: dict[str, Result] = field(default_factory=dict)
    # What was said, of which source first, and how often.
    warnings: dict[str, tuple[str, int]] = field(default_factory=dict)
    # Why it was ended before everything had been tried, and whether for wrong arguments.
    ended: str = ""
    refused: bool = False

    def rate(self) -> str:
        """How fast frames come from all nodes together."""
        return (
            f"{self.frames / max(self.elapsed_s, 1e-3):.1f} frames/s over {len(self.nodes)} node{'s' * (len(self.nodes) != 1)}"
        )

    def add(self, frames: int) -> None:
        """A result is there that has so many frames."""
        self.made, self.frames = self.made + 1, self.frames + frames


def connect(options: Options) -> None:
    """Joins a cluster, or starts one on this machine; `address` as Ray takes it.

    Raises:
        FarmError: there is none.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    cloudpickle.register_pickle_by_value(work)
    try:
        ray.init(address=options.address, logging_level=logging.ERROR, log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise FarmError(f"no Ray cluster: {' '.join(str(error).split())}") from error
    largest = max((node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"]), default=0)
    if largest < options.cpus:
        tell(f"warning: no node has {options.cpus} CPUs (the largest has {largest:g}): waiting for one that joins")


def tell(line: str) -> None:
    """A line for people, above the progress bar."""
    tqdm.write(line, file=sys.stderr)


def leave() -> None:
    """Leaves the cluster, and ends it if it was started here. What still runs is killed."""
    ray.shutdown()


class Farm:
    """A job at work."""

    def __init__(self, job: Job, options: Options):
        self.job, self.options, self.tally = job, options, Tally()
        self.perform = ray.remote(num_cpus=options.cpus, num_gpus=options.gpus, max_retries=0)(work.perform)
        self.running: dict[ray.ObjectRef[Outcome], Task] = {}
        self.unfit: dict[str, str] = {}
        self.alive: set[str] = set()
        self.looked_s, self.places = -LOOK_S, 1

    def run(self, units: list[Unit]) -> Tally:
        """Makes all results that can be made. Interrupted, it stops what runs."""
        size = self.options.shard if self.job.command == "render" else 1
        waiting = deque(Task(units[start : start + size]) for start in range(0, len(units), size))
        job, started_s = ray.put(self.job), time.monotonic()
        # Rewritten at most ten times a second, and only on a terminal.
        with tqdm(total=len(units), unit="", disable=None, bar_format="{n_fmt}/{total_fmt} |{bar}| {elapsed}{postfix}") as bar:
            try:
                while waiting or self.running:
                    self.look_around()
                    most = self.places + max(LEAST_WAITING, self.places)
                    while waiting and len(self.running) < most:
                        task = waiting.popleft()
                        self.running[self.placed(task).remote(job, task.units)] = task
                    refs = list(self.running)
                    if ray.wait(refs, num_returns=1, timeout=1.0)[0]:
                        # All that have ended meanwhile, as to look takes longer the more there are.
                        for ref in ray.wait(refs, num_returns=len(refs), timeout=0)[0]:
                            waiting.extend(self.note(self.running.pop(ref), ref))
                    self.end_early(waiting)
                    self.tally.elapsed_s = time.monotonic() - started_s
                    bar.n = self.tally.made + len(self.tally.failed)
                    bar.set_postfix_str(self.tally.rate())
            finally:
                for ref in self.running:
                    ray.cancel(ref, force=True)
        return self.tally

    def look_around(self) -> None:
        """Notes, every few seconds, which nodes there are."""
        if time.monotonic() - self.looked_s < LOOK_S:
            return
        self.looked_s = time.monotonic()
        alive = [node for node in ray.nodes() if node["Alive"]]
        self.alive = {node["NodeID"] for node in alive}
        self.places = max(1, sum(int(node["Resources"].get("CPU", 0) // self.options.cpus) for node in alive))
        if self.alive and self.alive <= self.unfit.keys():
            self.tally.ended = f"no node is left that can do it: {'; '.join(set(self.unfit.values()))}"
        for ref, task in self.running.items():
            # It waits for a node that is gone.
            if task.avoid and self.alive <= {*self.unfit, task.avoid}:
                ray.cancel(ref)

    def placed(self, task: Task) -> Any:
        """The task for nodes that are fit for it; rather not for the one where it failed, while there are others."""
        if self.alive <= {*self.unfit, task.avoid}:
            task.avoid = ""
        nodes = [*self.unfit, *([task.avoid] if task.avoid else [])]
        return self.perform.options(label_selector={"ray.io/node-id": f"!in({','.join(nodes)})"} if nodes else {})

    def note(self, task: Task, ref: ray.ObjectRef[Outcome]) -> list[Task]:
        """Takes note of what a task did; what is to be done again."""
        try:
            outcome: Outcome = ray.get(ref)
        except ray.exceptions.TaskCancelledError:
            return [task]
        except ray.exceptions.RayError as error:
            return self.after_death(task, error)
        if outcome.unfit:
            return self.without(outcome, task)
        self.tally.nodes.add(outcome.node)
        again = []
        for result in outcome.results:
            if not result.cause:
                self.tally.add(result.frames)
            # What is said twice in the same words, of two nodes where there are two, will be said again.
            elif task.failed >= self.options.retries or task.cause == result.cause:
                self.give_up(result)
            else:
                again.append(Task([result.unit], task.failed + 1, result.cause, outcome.node))
                continue
            self.warn(result)
        return again

    def after_death(self, task: Task, error: Exception) -> list[Task]:
        """What is left of a task whose worker or node died."""
        left = []
        for unit in task.units:
            if report := finished(self.job, unit):
                self.tally.add(frames_of(report))
            else:
                left.append(unit)
        if task.failed < self.options.retries:
            # Apart from each other, so that one that is to blame takes none with it again.
            return [Task([unit], task.failed + 1, task.cause, task.avoid) for unit in left]
        what = type(error).__name__
        cause = next((line.strip() for line in str(error).splitlines() if line.strip()), what)
        for unit in left:
            self.give_up(Result(unit, f"{what}: {cause}"))
        return []

    def without(self, outcome: Outcome, task: Task) -> list[Task]:
        """Keeps tasks away from a node that is unfit; that was no attempt."""
        if outcome.node not in self.unfit:
            self.unfit[outcome.node] = outcome.unfit
            tell(f"warning: {outcome.host} gets no tasks: {outcome.unfit}")
        self.looked_s = -LOOK_S
        return [task]

    def give_up(self, result: Result) -> None:
        self.tally.failed[result.unit.output] = result
        tell(f"failed: {result.unit.source}: {result.cause}")

    def warn(self, result: Result) -> None:
        """Tells a warning of the program once, and counts it."""
        for text in dict.fromkeys(result.warnings):
            general = text.replace(result.unit.source, "it")
            source, times = self.tally.warnings.get(general, (result.unit.source, 0))
            self.tally.warnings[general] = source, times + 1
            if not times:
                tell(f"warning: {source}: {text}")

    def end_early(self, waiting: deque[Task]) -> None:
        """Ends where it can come to nothing."""
        refused = [result for result in self.tally.failed.values() if result.refused]
        if not self.tally.made and len(refused) >= REFUSED_AT_MOST:
            self.tally.refused = True
            self.tally.ended = (
                f"the program refused the first {len(refused)} sources, so the flags are wrong: {refused[0].cause}"
            )
        if self.tally.ended:
            for ref in self.running:
                ray.cancel(ref, force=True)
            self.running.clear()
            waiting.clear()
