"""Small matrices on one thread: on two a fit takes three times as long."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Keeps the numerical libraries of this process to one thread as long as it is entered."""
    with _libraries().limit(limits=1):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """Looked for once: that takes as long as a fit."""
    return ThreadpoolController()
