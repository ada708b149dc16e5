"""One function called for many tasks, whoever calls it; the results come in the order of the tasks."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pickle import PickleError
from typing import Any, NamedTuple, TypeVar, cast

from acquisition import DataError, Remark
from lobewatch.measuring.workers.cluster import cluster, scheduler_remarks
from lobewatch.measuring.workers.software import SOFTWARE, Software

_log = logging.getLogger(__name__)
Task = TypeVar("Task")
Result = TypeVar("Result")
AHEAD = 3
"""Tasks that each worker has been given at most: those behind them and their results are in no memory; chosen."""

WORK_ERRORS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    PickleError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""Errors of the work itself; those of the way to it are others."""


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


def anything(_task: object, _result: object) -> bool:
    """Take every result."""
    return True


def share_work(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    workers: Workers,
    is_result: Callable[[Task, Any], bool] = anything,
) -> Iterator[Result]:
    """Results of `work`, a function of a module that depends on its argument alone, for each task, in order.

    is_result: whether an answer can be that of its task; what is not, and what fails elsewhere, is worked out here.
    DataError where a process is ended from outside, the cluster does not answer or has no workers, or runs another
    version. A worker of a cluster that dies is made up for by the others.
    """
    if not workers.are_elsewhere:
        yield from map(work, tasks)
        return
    waiting, refused = deque[tuple[Task, Future[Any]]](), list[str]()
    with _team(workers) as team:

        def take() -> Result:
            task, future = waiting.popleft()
            answer = _answer(team, future)
            if not isinstance(answer, Exception) and _holds(is_result, task, answer):
                return cast(Result, answer)
            refused.append(type(answer).__name__)
            return work(task)

        for task in tasks:
            waiting.append((task, team.executor.submit(_work_alone, work, task)))
            if len(waiting) >= AHEAD * team.n:
                yield take()
        while waiting:
            yield take()
    if refused:
        kinds = ", ".join(dict.fromkeys(refused))
        _log.warning("answers of workers that were no results (%s): %d, worked out here instead", kinds, len(refused))


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


def _answer(team: Team, future: Future[Any]) -> object:
    """What a worker with our software answers, or the error that it ended with; DataError from any other."""
    try:
        answer = team.result(future)
    except (DataError, BrokenExecutor):
        raise
    except WORK_ERRORS as error:
        return error
    if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[0], Software)):
        return TypeError()
    if answer[0] != SOFTWARE:
        raise DataError(f"a worker has {answer[0].text}, here is {SOFTWARE.text}; install the same on all")
    return answer[1]


def _holds(is_result: Callable[[Task, Any], bool], task: Task, answer: object) -> bool:
    try:
        return is_result(task, answer)
    except WORK_ERRORS:  # its fields hold anything
        return False
