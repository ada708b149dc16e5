"""CPU time of lobewatch compared with that of a competitor on the same problem, in alternating turns."""

from __future__ import annotations

import math
import resource
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

LEAST = 0.05
"""CPU time that a turn takes at least (s): quick work is done several times."""


class Race(NamedTuple):
    """Two ways to one answer."""

    question: str
    """Problem that is computed, with its size."""
    ours: Callable[[], object]
    """Way of lobewatch."""
    peer: str
    """Name of the other way."""
    theirs: Callable[[], object]
    """Other way."""
    rounds: int = 7
    """Turns that each is given."""
    part: float = 1.0
    """Part of the work that the peer does, whose time grows with the work."""


class Result(NamedTuple):
    """Result of a race."""

    question: str
    """Problem of the race."""
    ours_s: float
    """CPU time of lobewatch, median (s)."""
    peer: str
    """Competitor of the race."""
    theirs_s: float
    """CPU time of the peer for all of the work, median (s)."""
    times: float
    """Time of the competitor over ours, median of the rounds."""
    least: float
    """Smallest ratio of all rounds."""
    most: float
    """Largest ratio of all rounds."""


def run(race: Race, quick: bool = False) -> Result:
    """One after the other, round by round; what either does the first time only, imports say, is done before.

    quick: a round.
    """
    turns = [(work, _count(work)) for work in (race.ours, race.theirs)]
    rounds = [[_seconds(*turn) for turn in turns] for _ in range(1 if quick else race.rounds)]
    ours = [mine for mine, _ in rounds]
    theirs = [other / race.part for _, other in rounds]
    times = [other / mine for mine, other in zip(ours, theirs, strict=True)]
    return Result(
        race.question,
        statistics.median(ours),
        race.peer,
        statistics.median(theirs),
        statistics.median(times),
        min(times),
        max(times),
    )


def cpu() -> float:
    """CPU time of this process and its finished children (s)."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + used.ru_utime + used.ru_stime


def _count(work: Callable[[], object]) -> int:
    """Return the number of repetitions in a turn."""
    work()
    return math.ceil(LEAST / max(_seconds(work, 1), 1e-6))


def _seconds(work: Callable[[], object], count: int) -> float:
    begin = cpu()
    for _ in range(count):
        work()
    return (cpu() - begin) / count
