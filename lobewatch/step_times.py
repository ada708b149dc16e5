"""Time the steps of a command for its option --verbose."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


class _StepTimes(threading.local):
    """Times of the steps in this thread."""

    seconds: dict[str, float] | None = None
    """Time of each step (s), None if it is not measured."""
    nested = 0.0
    """Time of steps inside the running one (s)."""


STEP_TIMES = _StepTimes()
"""Times of the running command."""


@contextmanager
def time_step(name: str) -> Iterator[None]:
    """Add the time of a block or a function to a step, without the steps inside it."""
    if (seconds := STEP_TIMES.seconds) is None:
        yield
        return
    start, outer = time.perf_counter(), STEP_TIMES.nested
    STEP_TIMES.nested = 0.0
    try:
        yield
    finally:
        elapsed = time.perf_counter() - start
        seconds[name] = seconds.get(name, 0.0) + elapsed - STEP_TIMES.nested
        STEP_TIMES.nested = outer + elapsed
