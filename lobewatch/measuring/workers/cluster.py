"""The workers of a Dask cluster as an executor (extra `fleet`)."""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from acquisition import DataError, Remark

ENCRYPTED = ("tls", "wss")
"""Schemes of addresses under which Dask encrypts."""
ANSWER = 10.0
"""Time within which a scheduler answers (s); chosen."""
PATIENCE = 60.0
"""Time that a cluster may be without any worker (s); chosen."""
LOOK_EVERY = 2.0
"""Time between two looks whether workers are still there (s); chosen."""
COMING_EVERY = 0.2
"""Time between two looks whether the first worker has come (s); chosen."""


def scheduler_remarks(address: str) -> list[Remark]:
    """Remarks on a scheduler to which work is about to be given; DataError where this is no address of one."""
    scheme, host = _scheme_and_host(address)
    if scheme in ENCRYPTED or _is_here(host):
        return []
    text = "unencrypted, and whoever can reach it can run programs on all its computers and on this one"
    return [Remark("scheduler-open", f"--scheduler {address}", text, "use tls:// (docs/performance-replay.md)")]


def _scheme_and_host(address: str) -> tuple[str, str]:
    """DataError for what is no address, and without Dask."""
    try:
        from distributed.comm import get_address_host_port, parse_address
    except ImportError as error:
        raise DataError(f'--scheduler {address}: needs Dask; install it: pip install "lobewatch[fleet]"') from error
    try:
        return parse_address(address)[0], get_address_host_port(address)[0]
    except ValueError as error:
        allowed = "give tls://HOST:PORT, or tcp://HOST:PORT"
        raise DataError(f"--scheduler {address}: is no address of a scheduler ({error}); {allowed}") from error


def _is_here(host: str) -> bool:
    """Whether a host is this computer by its own name, or by an address that no other computer reaches."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() in ("localhost", socket.gethostname().lower())


async def _knock(address: str) -> None:
    """Connect once: a client that fails at anything but silence would be stuck for 20 s when it is dropped."""
    from distributed import Security
    from distributed.comm import connect

    connection = await connect(address, ANSWER, **Security().get_connection_args("client"))
    await connection.close()


@contextmanager
def cluster(address: str) -> Iterator[tuple[Executor, int, Callable[[Future[Any]], Any]]]:
    """The executor of the scheduler at an address, how many its workers are, and what waits for a result.

    DataError where none answers, it has no workers for a minute, or it is lost.
    """
    _scheme_and_host(address)
    from distributed import Client, KilledWorker

    try:
        with ThreadPoolExecutor(1) as thread:  # the caller may be in a loop of its own
            thread.submit(asyncio.run, _knock(address)).result()
        client = Client(address, timeout=ANSWER, set_as_default=False)
    except Exception as error:
        cure = "start one with: dask scheduler (tls:// and certificates: docs/performance-replay.md)"
        raise DataError(f"--scheduler {address}: no Dask scheduler answers there ({error}); {cure}") from error
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
