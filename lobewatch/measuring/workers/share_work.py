"""One function called for many tasks, whoever calls it; the results come in the order of the tasks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, NamedTuple, TypeVar

from acquisition import DataError, Remark
from lobewatch.measuring.workers.cluster import cluster, scheduler_remarks
from lobewatch.measuring.workers.software import SOFTWARE, Software

Task = TypeVar("Task")
Result = TypeVar("Result")
AHEAD = 3
"""Tasks that each worker has been given at most: those behind them and their results are in no memory; chosen."""


@dataclass(frozen=True)
class Workers:
    """The processes that share the work."""

    jobs: int = 1
    """Processes of this computer; 1: this one."""
    scheduler: str = ""
    """Address of a Dask scheduler, whose workers do it; empty for none."""

    def __post_init__(self) -> None:
        """Refuse both at once."""
        if self.jobs > 1 and self.scheduler:
            raise ValueError(f"--jobs {self.jobs} and --scheduler {self.scheduler}: give one of them")

    @property
    def are_elsewhere(self) -> bool:
        """Whether another process does the work."""
        return self.jobs > 1 or bool(self.scheduler)

    @property
    def remarks(self) -> list[Remark]:
        """Remarks on how they are reached; DataError where the scheduler has no address of one."""
        return scheduler_remarks(self.scheduler) if self.scheduler else []


class Team(NamedTuple):
    """The workers as they are reached."""

    executor: Executor
    """Executor that gives them their tasks."""
    n: int
    """Number of workers."""
    result: Callable[[Future[Any]], Any]
    """Function that waits for a result."""


def share_work(work: Callable[[Task], Result], tasks: Iterable[Task], workers: Workers) -> Iterator[Result]:
    """Results of `work`, a function of a module that depends on its argument alone, for each task, in order.

    DataError where a process is ended from outside, the cluster does not answer or has no workers, or runs another
    version. A worker of a cluster that dies is made up for by the others.
    """
    if not workers.are_elsewhere:
        yield from map(work, tasks)
        return
    waiting = deque[Future[tuple[Software, Result]]]()
    with _team(workers) as team:
        for task in tasks:
            waiting.append(team.executor.submit(_work_alone, work, task))
            if len(waiting) >= AHEAD * team.n:
                yield _take(team, waiting.popleft())
        while waiting:
            yield _take(team, waiting.popleft())


@contextmanager
def _team(workers: Workers) -> Iterator[Team]:
    if workers.scheduler:
        with cluster(workers.scheduler) as (executor, n, result):
            yield Team(executor, n, result)
        return
    try:
        with ProcessPoolExecutor(workers.jobs, get_context("spawn")) as pool:
            yield Team(pool, workers.jobs, lambda future: future.result())
    except BrokenProcessPool as error:
        text = f"one of the {workers.jobs} processes was ended from outside; nothing is stored"
        raise DataError(f"{text}; try again with fewer --jobs") from error


_alone = threading.Lock()


def _work_alone(work: Callable[[Task], Result], task: Task) -> tuple[Software, Result]:
    """One task at a time in a process: the threads of a worker would share the settings of its libraries."""
    with _alone:
        return SOFTWARE, work(task)


def _take(team: Team, future: Future[tuple[Software, Result]]) -> Result:
    """A result, from a worker with our software; DataError from any other."""
    answer: tuple[Software, Result] = team.result(future)
    software, result = answer
    if software != SOFTWARE:
        raise DataError(f"a worker has {software.text}, here is {SOFTWARE.text}; install the same on all")
    return result
