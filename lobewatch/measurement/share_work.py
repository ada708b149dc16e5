"""Share tasks among processes or the workers of a Dask cluster."""

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
    """Executor with its workers."""

    executor: Executor
    """Executor of the tasks."""
    worker_count: int
    """Number of workers."""
    wait_for_result: Callable[[Future[Any]], Any]
    """Function that waits for a result."""


ENCRYPTED_SCHEMES = ("tls", "wss")
"""Address schemes with encryption."""
SCHEDULER_TIMEOUT = 10.0
"""Time to wait for a scheduler (s); chosen."""
WORKER_TIMEOUT = 60.0
"""Time to wait for a first worker (s); chosen."""
WORKER_CHECK_INTERVAL = 2.0
"""Time between two checks for lost workers (s); chosen."""
WORKER_START_POLL_INTERVAL = 0.2
"""Time between two checks for the first worker (s); chosen."""


def scheduler_remarks(address: str) -> list[Remark]:
    """Return remarks on the address of a scheduler; DataError for an invalid address."""
    scheme, host = _parse_scheduler_address(address)
    if scheme in ENCRYPTED_SCHEMES or _is_local_host(host):
        return []
    text = "connection not encrypted: anyone with access can run programs on this computer and on all workers"
    return [Remark("scheduler-open", f"Workers.scheduler {address}", text, "Use tls:// (docs/several-computers.md)")]


def _parse_scheduler_address(address: str) -> tuple[str, str]:
    """Return scheme and host of an address; DataError for an invalid one, and without Dask."""
    try:
        from distributed.comm import get_address_host_port, parse_address

        return parse_address(address)[0], get_address_host_port(address)[0]
    except ImportError as error:
        cure = 'Install Dask with pip install "lobewatch[fleet]".'
        raise DataError(f"Workers.scheduler {address}: Dask is missing. {cure}") from error
    except ValueError as error:
        allowed = "Give tls://HOST:PORT or tcp://HOST:PORT."
        raise DataError(f"Workers.scheduler {address}: invalid address ({error}). {allowed}") from error


def _is_local_host(host: str) -> bool:
    """Tell whether a host is this computer."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() in ("localhost", socket.gethostname().lower())


async def _probe_scheduler(address: str) -> None:
    """Connect once, because a client that fails later would block for 20 s."""
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
        cure = 'Start a scheduler with "dask scheduler" (for tls:// see docs/several-computers.md).'
        raise DataError(f"{option}: no Dask scheduler answers ({error}). {cure}") from error
    with client:
        _wait_for_workers(client, address)
        try:
            with client.get_executor(pure=False) as executor:
                count = len(client.nthreads())
                yield WorkerPool(executor, count, lambda future: _wait_for_result(client, address, future))
        except KilledWorker as error:
            raise DataError(f"{option}: a task crashed several workers ({error})") from error
        except ModuleNotFoundError as error:
            raise DataError(f"{option}: {error} on a worker. Install lobewatch on all workers.") from error
        except (CancelledError, OSError) as error:
            if isinstance(error, OSError) and client.status == "running":
                raise
            raise DataError(f"{option}: connection to the scheduler lost. Repeat the command.") from error


def _wait_for_workers(client: Any, address: str) -> None:
    """Wait for a worker; DataError after a timeout."""
    begin = time.monotonic()
    while not client.nthreads():
        if client.status != "running":
            raise CancelledError
        if time.monotonic() - begin > WORKER_TIMEOUT:
            raise DataError(f'Workers.scheduler {address}: no workers. Start workers with "dask worker {address}".')
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
"""Largest number of waiting tasks per worker, which limits memory; chosen."""
TASK_ERRORS: tuple[type[Exception], ...] = (ArithmeticError, AssertionError, AttributeError, EOFError, LookupError)
TASK_ERRORS += (MemoryError, PickleError, RuntimeError, TypeError, ValueError)
"""Errors of a task itself, not of its transport."""


@dataclass(frozen=True)
class Workers:
    """Processes that share the tasks."""

    jobs: int = 1
    """Number of processes of this computer; 1: only this one."""
    scheduler: str = ""
    """Address of a Dask scheduler; empty without one."""

    def __post_init__(self) -> None:
        if self.jobs > 1 and self.scheduler:
            given = f"Workers.jobs {self.jobs} and Workers.scheduler {self.scheduler}"
            raise ValueError(f"{given} are both given. Leave out one of the two.")

    @property
    def use_other_processes(self) -> bool:
        """True if other processes do the work."""
        return self.jobs > 1 or bool(self.scheduler)

    @property
    def remarks(self) -> list[Remark]:
        """Remarks on the scheduler; DataError for an invalid address."""
        return scheduler_remarks(self.scheduler) if self.scheduler else []


def share_work(
    work: Callable[[Task], Result],
    tasks: Iterable[Task],
    workers: Workers,
    is_result: Callable[[Task, Any], bool] = lambda _task, _result: True,
) -> Iterator[Result]:
    """Yield the results of a function for each task, in order.

    work: function of a module that depends only on its argument. is_result: check of an answer; this process repeats a
    task with an invalid answer or an error elsewhere. Raises DataError if a process is killed, or the cluster does not
    answer, has no workers, or runs another version.
    """
    if not workers.use_other_processes:
        yield from map(work, tasks)
        return
    waiting, refused = deque[tuple[Task, Future[Any]]](), list[str]()
    with connect_cluster(workers.scheduler) if workers.scheduler else _start_processes(workers.jobs) as team:

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
        _log.warning("invalid answers of workers (%s): %d, computed on this computer instead", kinds, len(refused))


@contextmanager
def _start_processes(count: int) -> Iterator[WorkerPool]:
    """Start processes of this computer; DataError if one is killed."""
    try:
        with ProcessPoolExecutor(count, get_context("spawn")) as executor:
            yield WorkerPool(executor, count, lambda future: future.result())
    except BrokenProcessPool as error:
        text = f"one of the {count} processes was killed"
        raise DataError(f"{text}. Repeat the command with fewer Workers.jobs.") from error


_task_lock = threading.Lock()


def _run_task(work: Callable[[Task], Result], task: Task) -> tuple[SoftwareVersions, Result]:
    """Run one task at a time in a process, because threads would share the settings of its libraries."""
    with _task_lock:
        return CURRENT_SOFTWARE, work(task)


def _collect_answer(team: WorkerPool, future: Future[Any]) -> object:
    """Return the answer of a worker, or the error of its task; DataError for other software."""
    try:
        answer = team.wait_for_result(future)
    except (DataError, BrokenExecutor):
        raise
    except TASK_ERRORS as error:
        return error
    if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[0], SoftwareVersions)):
        return TypeError()
    if answer[0] != CURRENT_SOFTWARE:
        raise DataError(
            f"a worker has {answer[0].text}, not {CURRENT_SOFTWARE.text}. Install the same versions on all computers."
        )
    return answer[1]


def _is_valid_result(is_result: Callable[[Task, Any], bool], task: Task, answer: object) -> bool:
    try:
        return is_result(task, answer)
    except TASK_ERRORS:  # its fields hold anything
        return False
