"""The workers of a Dask cluster as an executor (extra `fleet`)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from typing import Any

from acquisition import DataError

ANSWER = 10.0
"""Time within which a scheduler answers (s); chosen."""
PATIENCE = 60.0
"""Time that a cluster may be without any worker (s); chosen."""
LOOK_EVERY = 2.0
"""Time between two looks whether workers are still there (s); chosen."""
COMING_EVERY = 0.2
"""Time between two looks whether the first worker has come (s); chosen."""


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, int, Callable[[Future[Any]], Any]]]:
    """The executor of the scheduler at an address, how many its workers are, and what waits for a result.

    DataError where none answers, it has no workers for a minute, or it is lost.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise DataError(f'--scheduler {address}: needs Dask; install it: pip install "lobewatch[fleet]"') from error
    try:
        client = Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError) as error:
        raise DataError(
            f"--scheduler {address}: no Dask scheduler answers there ({error}); start one with: dask scheduler"
        ) from error
    with client:
        _wait_for_workers(client, address)
        try:
            with client.get_executor(pure=False) as executor:
                yield executor, len(client.nthreads()), lambda future: _result(client, address, future)
        except KilledWorker as error:
            raise DataError(f"--scheduler {address}: a task has ended several workers ({error})") from error
        except ModuleNotFoundError as error:
            raise DataError(f"--scheduler {address}: {error} on a worker; install lobewatch there, too") from error
        except (CancelledError, OSError) as error:
            if isinstance(error, OSError) and client.status == "running":
                raise
            raise DataError(f"--scheduler {address}: the scheduler was lost; nothing is stored") from error


def _wait_for_workers(client: Any, address: str) -> None:
    """DataError where there are none after a while."""
    begin = time.monotonic()
    while not client.nthreads():
        if client.status != "running":
            raise CancelledError
        if time.monotonic() - begin > PATIENCE:
            raise DataError(f"--scheduler {address}: it has no workers; start some with: dask worker {address}")
        time.sleep(COMING_EVERY)


def _result(client: Any, address: str, future: Future[Any]) -> Any:
    while True:
        try:
            return future.result(LOOK_EVERY)
        except TimeoutError:
            if future.done():
                raise
            _wait_for_workers(client, address)
