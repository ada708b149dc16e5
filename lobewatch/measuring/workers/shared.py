"""One function called for many things, whoever calls it; the results come in the order of the things."""

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

from acquisition import DataError
from lobewatch.measuring.workers.cluster import cluster
from lobewatch.measuring.workers.software import SOFTWARE, Software

Asked = TypeVar("Asked")
Found = TypeVar("Found")
AHEAD = 3
"""Things that each worker has been given at most: what is asked and found of others is in no memory."""


@dataclass(frozen=True)
class Workers:
    """Who shares the work."""

    jobs: int = 1
    """Processes of this computer; 1: this one."""
    scheduler: str = ""
    """Address of a Dask scheduler, whose workers do it; empty for none."""

    def __post_init__(self) -> None:
        """Refuse both."""
        if self.jobs > 1 and self.scheduler:
            raise ValueError(f"--jobs {self.jobs} and --scheduler {self.scheduler}: give one of them")

    @property
    def are_elsewhere(self) -> bool:
        """Whether another process does the work."""
        return self.jobs > 1 or bool(self.scheduler)


class Team(NamedTuple):
    """Those who do it."""

    executor: Executor
    """That they are asked by."""
    n: int
    """How many they are."""
    result: Callable[[Future[Any]], Any]
    """Waits for one."""


def shared(work: Callable[[Asked], Found], asked: Iterable[Asked], workers: Workers) -> Iterator[Found]:
    """What `work`, a function of a module that depends on its argument alone, gives for each thing asked, in order.

    DataError where a process is ended from outside, the cluster does not answer or has no workers, or runs another
    version. A worker of a cluster that dies is made up for by the others.
    """
    if not workers.are_elsewhere:
        yield from map(work, asked)
        return
    waiting = deque[Future[tuple[Software, Found]]]()
    with _team(workers) as team:
        for one in asked:
            waiting.append(team.executor.submit(_told, work, one))
            if len(waiting) >= AHEAD * team.n:
                yield _checked(team, waiting.popleft())
        while waiting:
            yield _checked(team, waiting.popleft())


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
        told = f"one of the {workers.jobs} processes was ended from outside; nothing is stored"
        raise DataError(f"{told}; try again with fewer --jobs") from error


_alone = threading.Lock()


def _told(work: Callable[[Asked], Found], one: Asked) -> tuple[Software, Found]:
    """One thing at a time in a process: the threads of a worker would share the settings of its libraries."""
    with _alone:
        return SOFTWARE, work(one)


def _checked(team: Team, future: Future[tuple[Software, Found]]) -> Found:
    told: tuple[Software, Found] = team.result(future)
    software, found = told
    if software != SOFTWARE:
        raise DataError(f"a worker has {software.text}, here is {SOFTWARE.text}; install the same on all")
    return found
