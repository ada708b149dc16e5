"""Questions on a tap test from the numbers of its series: stiffness, frequency, and x against y."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np

from acquisition import Remark
from dsm import format_rounded
from lobewatch.arrays import Floats
from lobewatch.measurement.recording_questions import (
    DAMPING_JUMP,
    DIRECTION_STIFFNESS,
    EXCHANGED_DIRECTIONS,
    FREQUENCY_JUMP,
    FREQUENCY_RISE,
    NO_MODE_TO_FOLLOW,
    SAME_DIRECTION,
    STIFFNESS_DRIFT,
    STIFFNESS_JUMP,
)
from modal import Mode

NEW_LEVEL_CODES = frozenset((FREQUENCY_JUMP.code, STIFFNESS_JUMP.code, NO_MODE_TO_FOLLOW.code))
NEW_LEVEL_CODES |= {EXCHANGED_DIRECTIONS.code, DAMPING_JUMP.code}
"""Codes of accepted questions with which a new level of a series begins: earlier tests are no reference for it."""
STIFFNESS_EXPONENT, STIFFNESS_EXPONENT_STD = 2.0, 1.0
"""Exponent b of K ~ f^b as bearings wear, and its standard deviation between machines.

Two for a constant modal mass K / (2 pi f)^2, which belongs to tool and holder. Models of spindles have 0.1, if the tool
moves most, to 3.8, if the shaft does. The tests of a series narrow it down."""
STIFFNESS_STD, STIFFNESS_STD_TESTS = 0.052, 4
"""Relative standard deviation of K from test to test before a series shows its own, and the differences that it counts
for; chosen between a careful operator (3 %) and three different ones (6 %)."""
MAX_YOUNG_STD, N_YOUNG_CHANGES = 0.06, 24
"""Largest relative standard deviation of K that a series can show before it has so many changes from test to test.

Machines have 3 to 6 %. A gain that changes in every test is the larger part of the changes of a young series, and would
hide itself in its scatter."""
MAX_EXPONENT_DIFFERENCE = 1.9
"""Largest difference of the exponent b from STIFFNESS_EXPONENT in models of spindles (0.1 to 3.8)."""
N_FIRST_TESTS, N_NEWEST_TESTS = 3, 3
"""Largest numbers of tests at the two ends of a level whose medians of K are compared; chosen."""
FREQUENCY_STD = 0.003
"""Relative standard deviation of f from test to test by reclamping, before a series shows its own; chosen."""
N_STD_ASKED = 4.0
"""Number of standard deviations beyond which a value raises a question; chosen."""
N_RECENT_TESTS = 5
"""Largest number of tests whose median frequency a rise is compared with, so that slow wear hides none; chosen."""
STD_PER_MEDIAN = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute values."""
MAX_DAY = timedelta(hours=24)
"""Time between x and y that counts as one day; the older of them is shifted beyond it; chosen."""
ALIKE_FREQUENCY_CHANGE = 0.05
"""Relative difference of the frequencies of x and y within which their stiffness is compared; chosen."""
DIRECTION_DIFFERENCE = 0.05
"""Typical relative difference of the frequencies of a mode in x and in y, before a series shows its own; chosen."""
MAX_PAIRS, MIN_PAIRS_FOR_MEDIAN = 24, 3
"""Largest number of days whose differences of x and y count, or of tests whose damping counts, and
smallest number for their median; chosen."""
N_PRIOR_PAIRS = 2
"""Number of days for which the mean square of the differences counts next to their scatter; chosen."""
MAX_COMMON_DIFFERENCE, N_STD_COMMON = 0.0005, 5.0
"""Relative frequency difference of a mode in two tests of one direction, and its standard errors: the larger one ends
the suspicion; chosen."""
MIN_COMMON_PEAK_RATIO = 0.1
"""Peak of a mode over the followed one, from which it must be common to two tests of one direction; chosen."""
FREQUENCY_FLOOR = 1.5e-5
"""Relative standard error of a frequency at least; repeated tests agree no better (emulated: 0.6e-5 to 2e-5)."""
COMPUTED_DIFFERENCE = 1e-7
"""Relative frequency difference below which x and y were computed, not measured: noise is a hundred times larger."""


class EarlierTest(NamedTuple):
    """Followed mode of an earlier test of the series, without open questions."""

    time: datetime
    """Time of the tap test."""
    frequency: float
    """Natural frequency (Hz)."""
    stiffness: float
    """Stiffness K (N/m); NaN without force."""
    is_new_level: bool = False
    """True if a new level begins with it, because a person accepted a jump."""
    modes: tuple[tuple[float, float, float, float], ...] = ()
    """Frequency (Hz), damping ratio, stiffness (N/m) and phase (degrees) of all its modes."""


@dataclass(frozen=True)
class SeriesReference:
    """Tests that a tap test is compared with; oldest first."""

    own: tuple[EarlierTest, ...] = ()
    """Earlier tests of the same series and direction."""
    across: tuple[EarlierTest, ...] = ()
    """Earlier tests of the same series in the other direction, x or y."""
    same_day: tuple[float, ...] = ()
    """Frequencies of all modes of the newest test in the other direction (Hz); empty if it is older than a day."""

    @property
    def level(self) -> tuple[EarlierTest, ...]:
        """Tests of the same direction since the newest accepted jump, which is included."""
        return _split_levels(self.own)[-1]

    @property
    def levels(self) -> list[tuple[EarlierTest, ...]]:
        """Tests of each level of both directions."""
        return _split_levels(self.own) + _split_levels(self.across)


NO_REFERENCE = SeriesReference()
"""No earlier tests."""


class ExpectedValue(NamedTuple):
    """Value that the series leads to expect."""

    value: float
    """Expected value in SI units."""
    limit: float
    """Largest difference of the natural logarithms without a question."""

    def is_beyond(self, value: float) -> bool:
        """Tell whether a value is farther away than the limit."""
        return abs(math.log(value / self.value)) > self.limit


def check_series(now: Mode, reference: SeriesReference) -> Iterator[Remark]:
    """Yield the questions about a followed mode that does not fit the earlier tests of its series.

    Parameters
    ----------
    now
        Followed mode.
    reference
        Earlier tests of the series.
    """
    rise = _check_rise(now, reference)
    if rise is not None:
        yield rise
    elif now.has_stiffness:
        checks = (check_level_stiffness, _check_drift) if reference.own else (_check_other_direction,)
        asked = filter(None, (check(now, reference) for check in checks))
        yield from islice(asked, 1)


def _check_rise(now: Mode, reference: SeriesReference) -> Remark | None:
    """Return the question about a frequency that rose, which neither wear nor warmth explains, or None."""
    recent = np.array([test.frequency for test in reference.level[-N_RECENT_TESTS:]])
    if not recent.size:
        return None
    std = estimate_scatter([[test.frequency for test in level] for level in reference.levels], FREQUENCY_STD)
    limit = max(math.log1p(FREQUENCY_RISE.limit), N_STD_ASKED * std * math.sqrt(1 + math.pi / 2 / recent.size))
    before = float(np.median(recent))
    if math.log(now.frequency / before) <= limit:
        return None
    percent, count = 100 * (now.frequency / before - 1), recent.size
    asked = {"now": now.frequency, "percent": percent, "before": before, "count": count, "s": "s" * (count > 1)}
    return FREQUENCY_RISE.ask(f"{now.frequency:.0f} Hz", **asked)


def check_level_stiffness(now: Mode, reference: SeriesReference) -> Remark | None:
    """Return the question about a stiffness that the frequency does not explain, or None.

    Parameters
    ----------
    now
        Followed mode.
    reference
        Earlier tests of the series.
    """
    expected = expect_stiffness(reference, now.frequency)
    if expected is None or not expected.is_beyond(now.stiffness):
        return None
    here, there = (format_rounded(value, scale=1e6, digits=3) for value in (now.stiffness, expected.value))
    count, limit = len(reference.level), 100 * math.expm1(expected.limit)
    asked = {"now": here, "expected": there, "ratio": now.stiffness / expected.value, "s": "s" * (count > 1)}
    return STIFFNESS_JUMP.ask(f"{now.frequency:.0f} Hz", count=count, limit=limit, **asked)


def _check_drift(now: Mode, reference: SeriesReference) -> Remark | None:
    """Return the question about the newest tests of a level far from its first ones, or None.

    Small steps, each without a question, move the median of a series along, but not its first tests.
    """
    earlier = [(test.frequency, test.stiffness) for test in reference.level if math.isfinite(test.stiffness)]
    tests = np.log([*earlier, (now.frequency, now.stiffness)])
    std = _stiffness_std(reference)
    for count in range(1, min(N_FIRST_TESTS, len(earlier)) + 1):
        newest = tests[max(count, len(tests) - N_NEWEST_TESTS) :]
        (first_f, first_k), (f, k) = np.median(tests[:count], axis=0), np.median(newest, axis=0)
        spread = std * math.sqrt(_median_variance(count) + _median_variance(len(newest)))
        limit = N_STD_ASKED * spread + MAX_EXPONENT_DIFFERENCE * abs(f - first_f)
        expected = first_k + STIFFNESS_EXPONENT * (f - first_f)
        if abs(k - expected) > max(limit, math.log1p(STIFFNESS_DRIFT.limit)):
            here, there = (format_rounded(math.exp(value), scale=1e6, digits=3) for value in (k, expected))
            asked = {"now": here, "expected": there, "ratio": math.exp(k - expected), "recent": len(newest)}
            percent = 100 * math.expm1(limit)
            return STIFFNESS_DRIFT.ask(f"{now.frequency:.0f} Hz", count=count, limit=percent, **asked)
    return None


def expect_stiffness(reference: SeriesReference, frequency: float) -> ExpectedValue | None:
    """Return the stiffness K that a series leads to expect at a frequency, and the limit of its question.

    Linear regression of ln K on ln f with a prior slope, about medians, so that single tests move nothing. The limit is
    the larger of that of the question and four standard deviations of a further test.

    Parameters
    ----------
    reference
        Earlier tests of the series.
    frequency
        Natural frequency of the test (Hz).

    Returns
    -------
    ExpectedValue or None
        Expected stiffness (N/m) with the limit; None without an earlier test with K.
    """
    tests = [test for test in reference.level if math.isfinite(test.stiffness)]
    if not tests:
        return None
    at, mass = np.log([test.frequency for test in tests]), _log_masses(tests)
    std = _stiffness_std(reference)
    distance, new_distance = at - np.median(at), math.log(frequency) - float(np.median(at))
    weight = float(distance @ distance) + (std / STIFFNESS_EXPONENT_STD) ** 2
    slope = float(distance @ (mass - np.median(mass))) / weight
    slope = min(max(slope, -MAX_EXPONENT_DIFFERENCE), MAX_EXPONENT_DIFFERENCE)
    centre = float(np.median(mass - slope * distance)) + slope * new_distance
    spread = std * math.sqrt(1 + _median_variance(len(tests)) + new_distance**2 / weight)
    limit = max(math.log1p(STIFFNESS_JUMP.limit), N_STD_ASKED * spread)
    return ExpectedValue(math.exp(centre + STIFFNESS_EXPONENT * math.log(frequency)), limit)


def _log_masses(tests: Sequence[EarlierTest]) -> Floats:
    """Return ln(K / f^2) of the tests with K, shape (n,)."""
    known = [test for test in tests if math.isfinite(test.stiffness)]
    return np.array([math.log(test.stiffness) - STIFFNESS_EXPONENT * math.log(test.frequency) for test in known])


def _stiffness_std(reference: SeriesReference) -> float:
    """Return the relative standard deviation of K of a series."""
    masses = [_log_masses(level) for level in reference.levels]
    std = estimate_scatter([np.exp(mass) for mass in masses], STIFFNESS_STD)
    is_young = sum(max(mass.size - 1, 0) for mass in masses) < N_YOUNG_CHANGES
    return min(std, MAX_YOUNG_STD) if is_young else std


def _median_variance(count: int) -> float:
    """Return the variance of the median of normal values over that of one: exact for one and for very many."""
    return math.pi / (2 * count + math.pi - 2)


def estimate_scatter(series: Sequence[Sequence[float] | Floats], prior: float) -> float:
    """Return the relative standard deviation of values about slow trends, from the median of successive changes.

    Parameters
    ----------
    series
        Values of each level, in order of time.
    prior
        Relative standard deviation that counts as STIFFNESS_STD_TESTS changes.
    """
    changes = np.concatenate([np.abs(np.diff(np.log(values))) for values in series])
    if not changes.size:
        return prior
    own = STD_PER_MEDIAN * float(np.median(changes)) / math.sqrt(2)
    total = STIFFNESS_STD_TESTS * prior**2 + changes.size * own**2
    return math.sqrt(total / (STIFFNESS_STD_TESTS + changes.size))


def _check_other_direction(now: Mode, reference: SeriesReference) -> Remark | None:
    """Return the question about the first stiffness of a direction that is far from that of the other, or None."""
    level = [test for test in _split_levels(reference.across)[-1] if math.isfinite(test.stiffness)]
    if not level:
        return None
    frequency, stiffness = (float(np.median(values)) for values in np.transpose([test[1:3] for test in level]))
    ratio = now.stiffness / stiffness
    is_alike = abs(math.log(now.frequency / frequency)) <= ALIKE_FREQUENCY_CHANGE
    if not is_alike or max(ratio, 1 / ratio) <= DIRECTION_STIFFNESS.limit:
        return None
    here, there = (format_rounded(value, scale=1e6, digits=3) for value in (now.stiffness, stiffness))
    return DIRECTION_STIFFNESS.ask(f"{now.frequency:.0f} Hz", now=here, ratio=ratio, other=there)


def _split_levels(tests: Sequence[EarlierTest]) -> list[tuple[EarlierTest, ...]]:
    """Split tests at each accepted jump; one empty level without tests."""
    firsts = [0, *(i for i, test in enumerate(tests) if i and test.is_new_level), len(tests)]
    return [tuple(tests[first:last]) for first, last in pairwise(firsts)]


def check_same_direction(now: Mode, modes: Sequence[Mode], reference: SeriesReference) -> Remark | None:
    """Return the question about a test that repeats the other direction of the same day, or None.

    Likelihood of the frequency difference of the followed mode in one direction (its standard errors alone) over that
    in two (the differences of earlier days). Markov's inequality: of tests whose directions differ as expected, a share
    of at most 1 / limit is asked. The other modes move with the followed one, so they can only contradict.

    Parameters
    ----------
    now
        Followed mode.
    modes
        All modes of the test that count.
    reference
        Earlier tests of the series.
    """
    strong = [mode for mode in modes if mode.peak >= MIN_COMMON_PEAK_RATIO * now.peak]
    if not reference.same_day or not all(_is_common(mode, reference.same_day) for mode in strong):
        return None
    change = _nearest_change(now.frequency, reference.same_day)
    if abs(change) < COMPUTED_DIFFERENCE:
        return None
    one, (centre, std) = 2 * _relative_error(now) ** 2, expect_direction_difference(reference)
    two = one + std**2
    ratio = 0.5 * (math.log(two / one) - change**2 / one + (change - centre) ** 2 / two)
    if not ratio > math.log(SAME_DIRECTION.limit):
        return None
    percent = format_rounded(100 * abs(change), digits=1)
    return SAME_DIRECTION.ask(f"{now.frequency:.0f} Hz", now=now.frequency, percent=percent)


def _nearest_change(frequency: float, others: Sequence[float]) -> float:
    """Return ln of a frequency over the nearest of others."""
    return min((math.log(frequency / other) for other in others), key=abs)


def _relative_error(mode: Mode) -> float:
    return max(float(mode.standard_error[0]) / mode.frequency, FREQUENCY_FLOOR)


def _is_common(mode: Mode, others: Sequence[float]) -> bool:
    largest = max(MAX_COMMON_DIFFERENCE, N_STD_COMMON * math.sqrt(2) * _relative_error(mode))
    return abs(_nearest_change(mode.frequency, others)) <= largest


def expect_direction_difference(reference: SeriesReference) -> tuple[float, float]:
    """Return the expected ln of the frequency over that of the other direction, and its standard deviation.

    Parameters
    ----------
    reference
        Earlier tests of the series.
    """
    pairs = iterate_day_pairs(reference.own, reference.across)
    changes = np.array([math.log(own.frequency / other.frequency) for own, other in pairs])
    if not changes.size:
        return 0.0, DIRECTION_DIFFERENCE
    centre = float(np.median(changes)) if changes.size >= MIN_PAIRS_FOR_MEDIAN else 0.0
    own = STD_PER_MEDIAN * float(np.median(np.abs(changes - centre)))
    square = N_PRIOR_PAIRS * float(np.mean(changes**2)) + changes.size * own**2
    return centre, math.sqrt(square / (N_PRIOR_PAIRS + changes.size))


def iterate_day_pairs(
    own: Sequence[EarlierTest], across: Sequence[EarlierTest]
) -> Iterator[tuple[EarlierTest, EarlierTest]]:
    """Yield the newest tests of one direction, each with that of the other direction of the same day.

    Parameters
    ----------
    own
        Tests of one direction, oldest first.
    across
        Tests of the other direction, oldest first.
    """
    across = across[-2 * MAX_PAIRS :]
    for test in own[-MAX_PAIRS:]:
        near = min(across, key=lambda other: abs(other.time - test.time), default=None)
        if near is not None and abs(near.time - test.time) <= MAX_DAY:
            yield test, near
