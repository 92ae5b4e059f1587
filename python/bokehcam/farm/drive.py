"""Tasks on a Ray cluster: submission, retries, and accounting.

Ray's own retries are off: this module knows which results of a task exist, and why others failed.
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

# If the program rejects this many sources before the first result, the flags are at fault.
MAX_REFUSED = 3
# Minimum number of tasks queued beyond those that can run, so that nodes never wait.
MIN_WAITING = 8
NODE_POLL_S = 5.0


@dataclass(frozen=True)
class Options:
    """Resources of each task on a node, and the number of retries."""

    address: str | None
    cpus: int
    gpus: float
    shard: int
    retries: int


@dataclass
class Task:
    """Units that run together, the number of failures, and the program's error of a unit that is retried."""

    units: list[Unit]
    failed: int = 0
    cause: str = ""
    # The node of the failure.
    avoid: str = ""


@dataclass
class Tally:
    """Totals of the farm."""

    made: int = 0
    frames: int = 0
    elapsed_s: float = 0.0
    nodes: set[str] = field(default_factory=set)
    failed: dict[str, Result] = field(default_factory=dict)
    # Warnings: the text, its first source, and the number of occurrences.
    warnings: dict[str, tuple[str, int]] = field(default_factory=dict)
    # Reason for ending early, and whether the arguments were wrong.
    ended: str = ""
    refused: bool = False

    def rate(self) -> str:
        """Formats the frame rate of all nodes together."""
        return (
            f"{self.frames / max(self.elapsed_s, 1e-3):.1f} frames/s over {len(self.nodes)} node{'s' * (len(self.nodes) != 1)}"
        )

    def add(self, frames: int) -> None:
        """Counts a result with this number of frames."""
        self.made, self.frames = self.made + 1, self.frames + frames


def connect(options: Options) -> None:
    """Joins a cluster, or starts one on this machine; `address` as Ray takes it.

    Raises:
        FarmError: no cluster can be reached.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    cloudpickle.register_pickle_by_value(work)
    try:
        ray.init(address=options.address, logging_level=logging.ERROR, log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise FarmError(f"no Ray cluster: {' '.join(str(error).split())}") from error
    largest = max((node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"]), default=0)
    if largest < options.cpus:
        print_line(f"warning: no node has {options.cpus} CPUs (the largest has {largest:g}): waiting for one that joins")


def print_line(line: str) -> None:
    """Prints a line above the progress bar."""
    tqdm.write(line, file=sys.stderr)


def leave() -> None:
    """Leaves the cluster, and ends it if it was started here. What still runs is killed."""
    ray.shutdown()


class Farm:
    """A running job."""

    def __init__(self, job: Job, options: Options):
        self.job, self.options, self.tally = job, options, Tally()
        self.perform = ray.remote(num_cpus=options.cpus, num_gpus=options.gpus, max_retries=0)(work.perform)
        self.running: dict[ray.ObjectRef[Outcome], Task] = {}
        self.unfit: dict[str, str] = {}
        self.alive: set[str] = set()
        self.polled_s, self.places = -NODE_POLL_S, 1

    def run(self, units: list[Unit]) -> Tally:
        """Runs all units. If interrupted, stops the running tasks."""
        size = self.options.shard if self.job.command == "render" else 1
        waiting = deque(Task(units[start : start + size]) for start in range(0, len(units), size))
        job, started_s = ray.put(self.job), time.monotonic()
        # Rewritten at most ten times a second, and only on a terminal.
        with tqdm(total=len(units), unit="", disable=None, bar_format="{n_fmt}/{total_fmt} |{bar}| {elapsed}{postfix}") as bar:
            try:
                while waiting or self.running:
                    self.update_nodes()
                    limit = self.places + max(MIN_WAITING, self.places)
                    while waiting and len(self.running) < limit:
                        task = waiting.popleft()
                        self.running[self.place(task).remote(job, task.units)] = task
                    refs = list(self.running)
                    if ray.wait(refs, num_returns=1, timeout=1.0)[0]:
                        # All finished tasks at once, as polling takes longer the more there are.
                        for ref in ray.wait(refs, num_returns=len(refs), timeout=0)[0]:
                            waiting.extend(self.record(self.running.pop(ref), ref))
                    self.end_early(waiting)
                    self.tally.elapsed_s = time.monotonic() - started_s
                    bar.n = self.tally.made + len(self.tally.failed)
                    bar.set_postfix_str(self.tally.rate())
            finally:
                for ref in self.running:
                    ray.cancel(ref, force=True)
        return self.tally

    def update_nodes(self) -> None:
        """Updates the list of nodes every few seconds."""
        if time.monotonic() - self.polled_s < NODE_POLL_S:
            return
        self.polled_s = time.monotonic()
        alive = [node for node in ray.nodes() if node["Alive"]]
        self.alive = {node["NodeID"] for node in alive}
        self.places = max(1, sum(int(node["Resources"].get("CPU", 0) // self.options.cpus) for node in alive))
        if self.alive and self.alive <= self.unfit.keys():
            self.tally.ended = f"no node that could do the work is left: {'; '.join(set(self.unfit.values()))}"
        for ref, task in self.running.items():
            # The task waits for a node that has left.
            if task.avoid and self.alive <= {*self.unfit, task.avoid}:
                ray.cancel(ref)

    def place(self, task: Task) -> Any:
        """Restricts the task to fit nodes, and avoids the node of its failure while there are others."""
        if self.alive <= {*self.unfit, task.avoid}:
            task.avoid = ""
        nodes = [*self.unfit, *([task.avoid] if task.avoid else [])]
        return self.perform.options(label_selector={"ray.io/node-id": f"!in({','.join(nodes)})"} if nodes else {})

    def record(self, task: Task, ref: ray.ObjectRef[Outcome]) -> list[Task]:
        """Records the outcome of a task; returns the tasks to retry."""
        try:
            outcome: Outcome = ray.get(ref)
        except ray.exceptions.TaskCancelledError:
            return [task]
        except ray.exceptions.RayError as error:
            return self.retry_after_death(task, error)
        if outcome.unfit:
            return self.exclude_node(outcome, task)
        self.tally.nodes.add(outcome.node)
        again = []
        for result in outcome.results:
            if not result.cause:
                self.tally.add(result.frames)
            # The same error twice, on two nodes if there are two, would come again.
            elif task.failed >= self.options.retries or task.cause == result.cause:
                self.give_up(result)
            else:
                again.append(Task([result.unit], task.failed + 1, result.cause, outcome.node))
                continue
            self.warn(result)
        return again

    def retry_after_death(self, task: Task, error: Exception) -> list[Task]:
        """Returns the tasks to retry after the death of a worker or node."""
        left = []
        for unit in task.units:
            if report := finished(self.job, unit):
                self.tally.add(frames_of(report))
            else:
                left.append(unit)
        if task.failed < self.options.retries:
            # Separate tasks, so that a fatal unit takes no others with it again.
            return [Task([unit], task.failed + 1, task.cause, task.avoid) for unit in left]
        what = type(error).__name__
        cause = next((line.strip() for line in str(error).splitlines() if line.strip()), what)
        for unit in left:
            self.give_up(Result(unit, f"{what}: {cause}"))
        return []

    def exclude_node(self, outcome: Outcome, task: Task) -> list[Task]:
        """Keeps tasks away from an unfit node; this does not count as an attempt."""
        if outcome.node not in self.unfit:
            self.unfit[outcome.node] = outcome.unfit
            print_line(f"warning: {outcome.host} gets no tasks: {outcome.unfit}")
        self.polled_s = -NODE_POLL_S
        return [task]

    def give_up(self, result: Result) -> None:
        self.tally.failed[result.unit.output] = result
        print_line(f"failed: {result.unit.source}: {result.cause}")

    def warn(self, result: Result) -> None:
        """Prints a warning of the program once, and counts it."""
        for text in dict.fromkeys(result.warnings):
            general = text.replace(result.unit.source, "it")
            source, times = self.tally.warnings.get(general, (result.unit.source, 0))
            self.tally.warnings[general] = source, times + 1
            if not times:
                print_line(f"warning: {source}: {text}")

    def end_early(self, waiting: deque[Task]) -> None:
        """Ends the farm if no unit can succeed."""
        refused = [result for result in self.tally.failed.values() if result.refused]
        if not self.tally.made and len(refused) >= MAX_REFUSED:
            self.tally.refused = True
            self.tally.ended = (
                f"the program refused the first {len(refused)} sources, so the flags are wrong: {refused[0].cause}"
            )
        if self.tally.ended:
            for ref in self.running:
                ray.cancel(ref, force=True)
            self.running.clear()
            waiting.clear()
