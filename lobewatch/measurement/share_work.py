"""Share tasks among processes or the workers of a Dask cluster."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pickle import PickleError
from typing import Any, NamedTuple, TypeVar, cast

from acquisition import DataError, Remark
from lobewatch.measurement.software import CURRENT_SOFTWARE, SoftwareVersions

_log = logging.getLogger(__name__)
Task = TypeVar("Task")
Result = TypeVar("Result")


class WorkerPool(NamedTuple):
    """The workers as they are reached."""

    executor: Executor
    """Executor that gives them their tasks."""
    worker_count: int
    """Number of workers."""
    wait_for_result: Callable[[Future[Any]], Any]
    """Function that waits for a result."""


ENCRYPTED_SCHEMES = ("tls", "wss")
"""Schemes of addresses under which Dask encrypts."""
SCHEDULER_TIMEOUT = 10.0
"""Time within which a scheduler answers (s); chosen."""
WORKER_TIMEOUT = 60.0
"""Time that a cluster may be without any worker (s); chosen."""
WORKER_CHECK_INTERVAL = 2.0
"""Time between two looks whether workers are still there (s); chosen."""
WORKER_START_POLL_INTERVAL = 0.2
"""Time between two looks whether the first worker has come (s); chosen."""


def scheduler_remarks(address: str) -> list[Remark]:
    """Remarks on a scheduler to which work is about to be given; DataError where this is no address of one."""
    scheme, host = _parse_scheduler_address(address)
    if scheme in ENCRYPTED_SCHEMES or _is_local_host(host):
        return []
    text = "unencrypted, and whoever can reach it can run programs on all its computers and on this one"
    return [Remark("scheduler-open", f"Workers.scheduler {address}", text, "use tls:// (docs/performance-replay.md)")]


def _parse_scheduler_address(address: str) -> tuple[str, str]:
    """DataError for what is no address, and without Dask."""
    try:
        from distributed.comm import get_address_host_port, parse_address
    except ImportError as error:
        raise DataError(
            f'Workers.scheduler {address}: needs Dask; install it: pip install "lobewatch[fleet]"'
        ) from error
    try:
        return parse_address(address)[0], get_address_host_port(address)[0]
    except ValueError as error:
        allowed = "give tls://HOST:PORT, or tcp://HOST:PORT"
        raise DataError(f"Workers.scheduler {address}: is no address of a scheduler ({error}); {allowed}") from error


def _is_local_host(host: str) -> bool:
    """Whether a host is this computer by its own name, or by an address that no other computer reaches."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() in ("localhost", socket.gethostname().lower())


async def _probe_scheduler(address: str) -> None:
    """Connect once: a client that fails at anything but silence would be stuck for 20 s when it is dropped."""
    from distributed import Security
    from distributed.comm import connect

    connection = await connect(address, SCHEDULER_TIMEOUT, **Security().get_connection_args("client"))
    await connection.close()


@contextmanager
def connect_cluster(address: str) -> Iterator[WorkerPool]:
    """Connect to the workers of the scheduler at an address.

    Raises DataError if none answers, it has no workers for a minute, or it is lost.
    """
    option = f"Workers.scheduler {address}"
    _parse_scheduler_address(address)
    from distributed import Client, KilledWorker

    try:
        with ThreadPoolExecutor(1) as thread:  # the caller may be in a loop of its own
            thread.submit(asyncio.run, _probe_scheduler(address)).result()
        client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except Exception as error:
        cure = "start one with: dask scheduler (tls:// and certificates: docs/performance-replay.md)"
        raise DataError(f"{option}: no Dask scheduler answers there ({error}); {cure}") from error
    with client:
        _wait_for_workers(client, address)
        try:
            with client.get_executor(pure=False) as executor:
                count = len(client.nthreads())
                yield WorkerPool(executor, count, lambda future: _wait_for_result(client, address, future))
        except KilledWorker as error:
            raise DataError(f"{option}: a task has ended several workers ({error})") from error
        except ModuleNotFoundError as error:
            raise DataError(f"{option}: {error} on a worker; install lobewatch there, too") from error
        except (CancelledError, OSError) as error:
            if isinstance(error, OSError) and client.status == "running":
                raise
            raise DataError(f"{option}: the scheduler was lost; nothing is stored") from error


def _wait_for_workers(client: Any, address: str) -> None:
    """DataError where there are none after a while."""
    begin = time.monotonic()
    while not client.nthreads():
        if client.status != "running":
            raise CancelledError
        if time.monotonic() - begin > WORKER_TIMEOUT:
            raise DataError(f"Workers.scheduler {address}: it has no workers; start some with: dask worker {address}")
        time.sleep(WORKER_START_POLL_INTERVAL)


def _wait_for_result(client: Any, address: str, future: Future[Any]) -> Any:
    while True:
        try:
            return future.result(WORKER_CHECK_INTERVAL)
        except TimeoutError:
            if future.done():
                raise
            _wait_for_workers(client, address)


TASKS_PER_WORKER = 3
"""Tasks that each worker has been given at most: those behind them and their results are in no memory; chosen."""

TASK_ERRORS = (
    *(ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, MemoryError),
    *(PickleError, RuntimeError, TypeError, ValueError),
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
            raise ValueError(f"Workers.jobs {self.jobs} and Workers.scheduler {self.scheduler}: give one of them")

    @property
    def use_other_processes(self) -> bool:
        """Whether another process does the work."""
        return self.jobs > 1 or bool(self.scheduler)

    @property
    def remarks(self) -> list[Remark]:
        """Remarks on how they are reached; DataError where the scheduler has no address of one."""
        return scheduler_remarks(self.scheduler) if self.scheduler else []


def share_work(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    workers: Workers,
    is_result: Callable[[Task, Any], bool] = lambda _task, _result: True,
) -> Iterator[Result]:
    """Results of `work`, a function of a module that depends on its argument alone, for each task, in order.

    is_result: whether an answer can be that of its task; what is not, and what fails elsewhere, is worked out here.
    DataError where a process is ended from outside, the cluster does not answer or has no workers, or runs another
    version. A worker of a cluster that dies is made up for by the others.
    """
    if not workers.use_other_processes:
        yield from map(work, tasks)
        return
    waiting, refused = deque[tuple[Task, Future[Any]]](), list[str]()
    with _open_pool(workers) as team:

        def take() -> Result:
            task, future = waiting.popleft()
            answer = _collect_answer(team, future)
            if not isinstance(answer, Exception) and _is_valid_result(is_result, task, answer):
                return cast(Result, answer)
            refused.append(type(answer).__name__)
            return work(task)

        for task in tasks:
            waiting.append((task, team.executor.submit(_run_task, work, task)))
            if len(waiting) >= TASKS_PER_WORKER * team.worker_count:
                yield take()
        while waiting:
            yield take()
    if refused:
        kinds = ", ".join(dict.fromkeys(refused))
        _log.warning("answers of workers that were no results (%s): %d, worked out here instead", kinds, len(refused))


@contextmanager
def _open_pool(workers: Workers) -> Iterator[WorkerPool]:
    if workers.scheduler:
        with connect_cluster(workers.scheduler) as pool:
            yield pool
        return
    try:
        with ProcessPoolExecutor(workers.jobs, get_context("spawn")) as pool:
            yield WorkerPool(pool, workers.jobs, lambda future: future.result())
    except BrokenProcessPool as error:
        text = f"one of the {workers.jobs} processes was ended from outside; nothing is stored"
        raise DataError(f"{text}; try again with fewer Workers.jobs") from error


_task_lock = threading.Lock()


def _run_task(work: Callable[[Task], Result], task: Task) -> tuple[SoftwareVersions, Result]:
    """One task at a time in a process: the threads of a worker would share the settings of its libraries."""
    with _task_lock:
        return CURRENT_SOFTWARE, work(task)


def _collect_answer(team: WorkerPool, future: Future[Any]) -> object:
    """What a worker with our software answers, or the error that it ended with; DataError from any other."""
    try:
        answer = team.wait_for_result(future)
    except (DataError, BrokenExecutor):
        raise
    except TASK_ERRORS as error:
        return error
    if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[0], SoftwareVersions)):
        return TypeError()
    if answer[0] != CURRENT_SOFTWARE:
        raise DataError(f"a worker has {answer[0].text}, here is {CURRENT_SOFTWARE.text}; install the same on all")
    return answer[1]


def _is_valid_result(is_result: Callable[[Task, Any], bool], task: Task, answer: object) -> bool:
    try:
        return is_result(task, answer)
    except TASK_ERRORS:  # its fields hold anything
        return False
