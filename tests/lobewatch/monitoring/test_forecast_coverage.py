"""Coverage of 80 % forecast ranges over possible trends and three kinds of measurement."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.monitoring.forecast import DateRange, Forecast, forecast_series

Floats = NDArray[np.float64]
Random = np.random.Generator
LEVEL = 3.0
"""Fall (%) whose date is looked for."""
DESIGNS: dict[str, tuple[Callable[[Random], Floats], float]] = {
    "24 monthly, 0.3 %": (lambda _: np.arange(24.0), 0.3),
    "60 monthly, 0.1 %": (lambda _: np.arange(60.0), 0.1),
    "16 at 0.2 to 6 months, 0.3 %": (lambda r: np.concatenate([[0.0], np.cumsum(r.uniform(0.2, 6.0, 15))]), 0.3),
}
"""Dates of tap tests (months) and scatter (%)."""
FLOORS = {
    "line": 75,
    "broken line": 75,
    "two breaks": 75,
    "line with a season": 75,
    "crash, then line": 70,
    "wiener": 60,
    "gamma": 60,
    "shocks": 60,
    "run-away": 55,
    "exponential": 0,
    "saturating": 0,
}
"""Least share (%) over the three designs together."""
LATE_FLOORS = {"late power": 65, "late exponential": 50, "late run-away": 75}
"""The same for wear that begins late and accelerates."""
STEADY = ("none", "step", "settled")
TODAY = ("none", "line", "slope", "step", "curve")
"""Shapes without changes of rate, crashes, wandering and run-away."""


class History(NamedTuple):
    """Tap tests of one spindle."""

    dates: Floats
    percents: Floats
    truth: float
    """Date at which it has fallen by the level first; infinite where never."""


def fall_of(course: str, r: Random, span: float, end: float) -> Callable[[Floats], Floats]:
    """Fall (%) over the date; the level is reached at the end."""
    bend, late, rate = r.uniform(0.2, 0.75) * span, r.uniform(0.5, 0.8) * span, r.uniform(1, 4) / span
    early, (faster, fastest) = r.uniform(0.15, 0.5) * span, r.uniform(2, 5, 2)
    power, last, phase = r.uniform(0.3, 1.0), end * r.uniform(1.1, 1.8), r.random()

    def breaks(t: Floats) -> Floats:
        rates = np.minimum(t, early) + faster * np.clip(t - early, 0, late - early)
        return np.asarray(rates + faster * fastest * np.maximum(t - late, 0))

    def scaled(curve: Callable[[Floats], Floats]) -> Callable[[Floats], Floats]:
        return lambda t: np.asarray(LEVEL * curve(t) / curve(np.array([end]))[0])

    other = r.spawn(1)[0]  # leaves the histories of the other courses as they are
    onset, late_power, growth = (other.uniform(*limits) for limits in ((0.2, 0.75), (1.5, 4.0), (1.0, 4.0)))

    def elapsed(t: Floats) -> Floats:
        """Time since the onset over that from there to the last test."""
        return np.asarray(np.maximum(t / span - onset, 0) / (1 - onset))

    failure = float(elapsed(np.array([end]))[0]) * last / end

    courses: dict[str, Callable[[Floats], Floats]] = {
        "line": scaled(lambda t: t),
        "broken line": scaled(lambda t: np.maximum(t - bend, 0)),
        "two breaks": scaled(breaks),
        "line with a season": lambda t: LEVEL * t / end + 0.3 * np.sin(2 * np.pi * (t / 12 + phase)),
        "crash, then line": lambda t: LEVEL * (0.3 * (t >= bend) + 0.7 * np.maximum(t - bend, 0) / (end - bend)),
        "run-away": scaled(lambda t: (1 - t / last) ** -power - 1),
        "exponential": scaled(lambda t: np.asarray(np.expm1(rate * t))),
        "saturating": scaled(lambda t: np.asarray(-np.expm1(-rate * t))),
        "late power": scaled(lambda t: elapsed(t) ** late_power),
        "late exponential": scaled(lambda t: np.asarray(np.expm1(growth * elapsed(t)))),
        "late run-away": scaled(lambda t: (1 - elapsed(t) / failure) ** -power - 1),
        "none": lambda t: 0 * t,
        "step": lambda t: (t > bend).astype(np.float64),
        "settled": lambda t: np.asarray(-0.5 * np.expm1(-t / 3)),
    }
    return courses[course]


def wandering_history(course: str, r: Random, dates: Floats, scatter: float) -> History:
    """Simulate independent increments of variance 1.5 drift^2 a month, or crashes at 0.4 a month."""
    span, count = float(dates[-1]), 4000
    at = np.linspace(0, 2 * span, count + 1)
    step = float(at[1])
    while True:
        drift = LEVEL / (span * (1 + r.uniform(0.1, 1.0)))
        increments = {
            "wiener": lambda drift=drift: r.normal(drift * step, drift * np.sqrt(1.5 * step), count),
            "gamma": lambda drift=drift: r.gamma(step / 1.5, 1.5 * drift, count),
            "shocks": lambda drift=drift: (
                r.gamma(np.maximum(hits := r.poisson(0.4 * step, count), 1e-9), drift / 0.4) * (hits > 0)
            ),
        }[course]()
        falls = np.concatenate([[0.0], np.cumsum(increments)])
        reached = np.flatnonzero(falls >= LEVEL)
        if reached.size and 1.15 * span <= at[reached[0]] <= 1.9 * span:
            percents = -np.interp(dates, at, falls) + r.normal(0, scatter, dates.size)
            return History(dates, percents, float(at[reached[0]]))


def history(course: str, design: str, r: Random) -> History:
    dates, scatter = DESIGNS[design][0](r), DESIGNS[design][1]
    if course in ("wiener", "gamma", "shocks"):
        return wandering_history(course, r, dates, scatter)
    span = float(dates[-1])
    end = span * (1 + r.uniform(0.15, 0.9))
    percents = -fall_of(course, r, span, end)(dates) + r.normal(0, scatter, dates.size)
    return History(dates, percents, np.inf if course in STEADY else end)


def foretold(past: History) -> Forecast:
    return forecast_series(past.dates, past.percents, 3 * float(past.dates[-1]))


def study(course: str, count: int) -> list[tuple[History, DateRange]]:
    """Histories of all designs, and the range of each."""
    pairs = []
    for number, design in enumerate(DESIGNS):
        r = np.random.default_rng([30, number, *course.encode()])
        level = -LEVEL - (course == "step")
        pairs += [
            (past, foretold(past).crossing_dates(level)) for past in (history(course, design, r) for _ in range(count))
        ]
    return pairs


def share_held(pairs: list[tuple[History, DateRange]]) -> float:
    return 100 * float(np.mean([dates.earliest <= past.truth <= dates.latest for past, dates in pairs]))


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("course", [*FLOORS, *LATE_FLOORS])
def test_80_percent_ranges_hold_the_date_of_a_trend(course: str) -> None:
    pairs = study(course, 300)
    designs = [share_held(pairs[300 * n : 300 * (n + 1)]) for n in range(3)]
    print(course, *(f"{share:.0f}" for share in designs))  # noqa: T201
    assert share_held(pairs) >= (FLOORS | LATE_FLOORS)[course]


@pytest.mark.long
@pytest.mark.parametrize("course", STEADY)
def test_no_range_is_announced_for_what_does_not_fall(course: str) -> None:
    announced = [np.isfinite(dates.latest) for _, dates in study(course, 300)]
    print(course, f"{100 * np.mean(announced):.1f}")  # noqa: T201
    assert np.mean(announced) <= 0.03


def of_today(found: Forecast) -> Forecast:
    """Return the mixture without the shapes that widen it."""
    kept = np.array([shape.kind in TODAY for shape in found.shapes])
    weight = found.weight[kept] / found.weight[kept].sum()
    shapes = tuple(shape for shape, is_kept in zip(found.shapes, kept, strict=True) if is_kept)
    rows = {"mean": found.mean[kept], "error": found.error[kept], "freedom": found.freedom[kept]}
    return found._replace(shapes=shapes, weight=weight, **rows)


@pytest.mark.parametrize("design", DESIGNS)
def test_the_range_of_a_straight_line_is_at_most_1_6_times_as_wide(design: str) -> None:
    r, widths = np.random.default_rng(31), []
    for _ in range(30):
        found = foretold(history("line", design, r))
        ranges = [one.crossing_dates(-LEVEL) for one in (found, of_today(found))]
        widths.append([dates.latest - dates.earliest for dates in ranges])
    wide, narrow = np.median(widths, axis=0)
    assert 0.9 <= wide / narrow <= 1.6


def test_most_ranges_hold_the_date_whatever_the_trend() -> None:
    pairs = [pair for course in FLOORS for pair in study(course, 3)]
    assert share_held(pairs) >= 60


def test_most_ranges_hold_the_date_of_wear_that_begins_late() -> None:
    pasts = []
    for course in LATE_FLOORS:
        r = np.random.default_rng([33, *course.encode()])
        pasts += [history(course, "24 monthly, 0.3 %", r) for _ in range(8)]
    assert share_held([(past, foretold(past).crossing_dates(-LEVEL)) for past in pasts]) >= 65
