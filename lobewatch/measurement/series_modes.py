"""Questions on a tap test from all modes of its series: another spindle, exchanged directions, unstated window."""

import math
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from acquisition import Remark
from lobewatch.arrays import Floats
from lobewatch.measurement.recording_questions import DAMPING_JUMP, EXCHANGED_DIRECTIONS, MODE_JUMP
from lobewatch.measurement.series_questions import (
    MAX_PAIRS,
    MIN_PAIRS_FOR_MEDIAN,
    N_PRIOR_PAIRS,
    N_RECENT_TESTS,
    EarlierTest,
    SeriesReference,
    check_level_stiffness,
    check_same_direction,
    check_series,
    iterate_day_pairs,
)
from modal import Mode

MIN_PEAK_RATIO = 0.05
"""Peak of a mode over the largest one, from which it is compared; chosen."""
MAX_MATCH_CHANGE = 0.2
"""Largest ln of a frequency ratio within which two modes can be one; chosen, below the spacing of most strong modes."""
MAX_MODE_FALL = 0.10
"""Relative fall of a mode since any recent test that wear or a crash explains; chosen. Beyond it is another mode."""
DIRECTION_STD = 0.001
"""Relative standard deviation of the frequency difference of x and y of one day, before a series shows its own.

Both are tapped in one clamping, so it is below FREQUENCY_STD; chosen."""
MAX_EXCHANGED_STD = 4.0
"""Largest distance from the exchanged directions in standard deviations; chosen. Farther away it is another tool."""
DAMPING_STD, N_PRIOR_DAMPINGS = 0.03, 1
"""Relative standard deviation of a damping ratio from test to test before a series shows its own, and the number of
tests that it counts for; chosen."""
MIN_MODE_TESTS = 3
"""Smallest number of earlier tests that show the damping of a series, or the stiffness of another mode; chosen."""
MIN_STIFFNESS_PEAK_RATIO = 0.1
"""Peak of a mode over the largest one, from which its stiffness is compared; chosen. A weaker fit is uncertain."""
MAX_WINDOW_FREQUENCY_CHANGE = 0.02
"""Largest relative frequency change with a raised damping that a window explains: a window changes none; chosen."""
MAX_WINDOW_DISTANCE, N_STD_WINDOW = 3.0, 3.8
"""Largest distance of each mode from the common rise, and number of standard deviations as unlikely as the rise that
raises the question; chosen. Both must hold, so it is less than N_STD_ASKED."""


def find_series_questions(followed: Mode, modes: Sequence[Mode], reference: SeriesReference) -> tuple[Remark, ...]:
    """Return the questions about a tap test that does not fit the earlier tests of its series.

    Parameters
    ----------
    followed
        Followed mode.
    modes
        All modes of the test that count.
    reference
        Earlier tests of the series.

    Returns
    -------
    tuple of Remark
        Questions. One about all modes is asked only if the followed mode raises none.
    """
    same = check_same_direction(followed, modes, reference)
    asked = (*check_series(followed, reference), *filter(None, [same]))
    if not asked:
        change = followed.frequency / reference.level[-1].frequency if reference.level else 1.0
        asked = (*islice(check_all_modes(modes, reference, change), 1),)
    return asked


def check_all_modes(modes: Sequence[Mode], reference: SeriesReference, change: float = 1.0) -> Iterator[Remark]:
    """Yield the questions about all modes of a test that do not fit the earlier tests of its series.

    Parameters
    ----------
    modes
        Modes of the test that count.
    reference
        Earlier tests of the series.
    change
        Frequency of the followed mode over that of the newest test. The others may move as far.
    """
    others = check_other_modes(modes, reference, change)
    checks = check_exchanged_directions, check_other_stiffness, check_common_damping
    yield from filter(None, (others, *(check(modes, reference) for check in checks)))


def check_other_modes(modes: Sequence[Mode], reference: SeriesReference, change: float = 1.0) -> Remark | None:
    """Return the question about a strong mode of all recent tests that is elsewhere now, or None.

    Wear lowers modes slowly and raises none. So a strong mode that is gone, with a strong one that no recent test has,
    is another spindle, although the followed mode of the tool is the same.

    change: frequency of the followed mode over that of the newest test. The others may move as far.
    """
    recent = [_tabulate_test(test)[:, 0] for test in reference.level[-N_RECENT_TESTS:]]
    if not recent:
        return None
    now, strong = _tabulate(modes)[:, 0], _select_strong(_tabulate(modes))[:, 0]
    before = _select_strong(_tabulate_test(reference.level[-1]))[:, 0]
    lost = [f for f in before if f not in _match_modes(recent[-1], now, change)]
    lost = [f for f in lost if all(f in _match_modes(before, test) for test in recent)]
    new = [f for f in strong if not any(f in _match_modes(test, now, change).values() for test in recent)]
    if not lost or not new:
        return None
    then = min(lost, key=lambda f: abs(math.log(f / new[0])))
    return MODE_JUMP.ask(f"{new[0]:.0f} Hz", now=new[0], before=then, count=len(recent), s="s" * (len(recent) > 1))


def _match_modes(before: Floats, now: Floats, change: float = 1.0) -> dict[float, float]:
    """Return the frequency that each earlier one has become, nearest first; each counts once.

    change: frequency ratio of another mode, by which these may have moved, too.
    """
    low, high = (1 - MAX_MODE_FALL) * min(change, 1.0), (1 + MODE_JUMP.limit) * max(change, 1.0)
    pairs = [(float(f), float(g)) for f in before for g in now if low <= g / f <= high]
    found: dict[float, float] = {}
    for f, g in sorted(pairs, key=lambda pair: abs(math.log(pair[1] / pair[0]))):
        if f not in found and g not in found.values():
            found[f] = g
    return found


def check_exchanged_directions(modes: Sequence[Mode], reference: SeriesReference) -> Remark | None:
    """Return the question about x and y of one day that differ the other way round than on earlier days, or None.

    Both directions are tapped in one clamping, so its scatter cancels in their difference.
    """
    days = [(_tabulate_test(own), _tabulate_test(other)) for own, other in _level_pairs(reference)]
    now, other = _select_strong(_tabulate(modes))[:, 0], np.array(reference.same_day)
    if not other.size or len(days) < MIN_PAIRS_FOR_MEDIAN:
        return None
    earlier = [np.log(own / _find(own, y)[:, 0]) for x, y in days for own in [_find(now, x)[:, 0]]]
    changes = np.array([np.log(now / _find(now, other[:, np.newaxis])[:, 0]), *earlier])
    changes, now = changes[:, np.all(np.isfinite(changes), axis=0)], now[np.all(np.isfinite(changes), axis=0)]
    if not now.size:
        return None
    likelihood, farthest = _compare_names(changes[0], changes[1:])
    if likelihood <= math.log(EXCHANGED_DIRECTIONS.limit):
        return None
    values = now[farthest], 100 * changes[0, farthest], 100 * float(np.mean(changes[1:, farthest]))
    asked = dict(zip(("now", "percent", "usual"), values, strict=True))
    return EXCHANGED_DIRECTIONS.ask(f"{now[farthest]:.0f} Hz", days=len(days), **asked)


def _compare_names(change: Floats, earlier: Floats) -> tuple[float, int]:
    """Return ln of the likelihood of exchanged over right names, and the mode that shows it best.

    Student's distribution of one further value, as the scatter of a few days is uncertain. Reclamping moves all modes
    together, so only one mode counts. The others can contradict.

    change: ln of the frequencies over those of the other direction, shape (modes,); earlier: shape (days, modes).
    """
    centre, freedom = np.mean(earlier, axis=0), len(earlier) - 1 + N_PRIOR_PAIRS
    squares = np.sum((earlier - centre) ** 2, axis=0) + N_PRIOR_PAIRS * DIRECTION_STD**2
    variance = squares / freedom * (1 + 1 / len(earlier))
    right, exchanged = (change - centre) ** 2 / variance, (change + centre) ** 2 / variance
    farthest = int(np.argmax(centre**2 / variance))
    likelihood = (freedom + 1) / 2 * np.log((freedom + right) / (freedom + exchanged))
    is_exchanged = np.max(exchanged) <= MAX_EXCHANGED_STD**2
    return float(likelihood[farthest]) if is_exchanged else -math.inf, farthest


def _level_pairs(reference: SeriesReference) -> list[tuple[EarlierTest, EarlierTest]]:
    """Return the earlier days of the level on which both directions have modes."""
    pairs = iterate_day_pairs(reference.level, reference.across)
    return [(own, other) for own, other in pairs if own.modes and other.modes]


def check_other_stiffness(modes: Sequence[Mode], reference: SeriesReference) -> Remark | None:
    """Return the question about the stiffness of any strong mode that does not fit its earlier tests, or None.

    Hits away from the tip change each mode by a factor of its own, that of the tool most. The scatter of this mode
    and that of all modes both count, as that of one in a few tests is uncertain.
    """
    strongest = max((mode.peak for mode in modes), default=0.0)
    strong = [mode for mode in modes if mode.peak >= MIN_STIFFNESS_PEAK_RATIO * strongest]
    series = [_follow(mode.frequency, tests) for mode in strong for tests in (reference.level, reference.across)]
    common = tuple(test for tests in series for test in tests)
    for mode, own, across in zip(strong, series[::2], series[1::2], strict=True):
        asked = [check_level_stiffness(mode, SeriesReference(own, scatter)) for scatter in (across, common)]
        if len(own) >= MIN_MODE_TESTS and all(asked):
            return asked[0]
    return None


def _follow(frequency: float, tests: Sequence[EarlierTest]) -> tuple[EarlierTest, ...]:
    """Return the tests that have a mode near a frequency (Hz), with this mode as the followed one."""
    near = ((test, min(test.modes, key=lambda mode: abs(mode[0] - frequency), default=None)) for test in tests)
    return tuple(
        test._replace(frequency=mode[0], stiffness=mode[2])
        for test, mode in near
        if mode is not None and mode[2] > 0 and abs(mode[0] / frequency - 1) <= MODE_JUMP.limit
    )


def check_common_damping(modes: Sequence[Mode], reference: SeriesReference) -> Remark | None:
    """Return the question about decay rates zeta 2 pi f that rose by one constant in all modes, or None.

    An exponential window of time constant T raises each by 1 / T and changes no frequency. Damping of joints and
    bearings changes by a share of its own in each mode.

    References
    ----------
    Fladung & Rost (1997), Application and correction of the exponential window for frequency response functions,
    Mechanical Systems and Signal Processing 11(1).
    """
    now, tests = _select_strong(_tabulate(modes)), reference.level[-MAX_PAIRS:]
    if len(tests) < MIN_MODE_TESTS or len(now) < 2:
        return None
    then = _trace(now, tests)
    if not np.all(np.isfinite(then)):
        return None
    usual = np.median(then, axis=0)
    if np.any(np.abs(now[:, 0] / usual[:, 0] - 1) > MAX_WINDOW_FREQUENCY_CHANGE):
        return None
    across = _trace(now, reference.across[-MAX_PAIRS:])
    both = [rows[:, :, 1] for rows in (then, across[np.all(np.isfinite(across[:, :, 1]), axis=1)])]
    weight = usual[:, 1] ** -2 / np.sum(usual[:, 1] ** -2)
    spread, freedom = _estimate_spread([rates @ weight for rates in both])
    own_spread, _ = _estimate_spread([rates.T for rates in both])
    rise = now[:, 1] - usual[:, 1]
    common, std = float(rise @ weight), math.sqrt(1 + 1 / len(tests)) * usual[:, 1]
    is_common = np.all((rise > 0) & (np.abs(rise - common) <= MAX_WINDOW_DISTANCE * own_spread * std))
    if not is_common or common <= _student_limit(freedom) * spread * float(std @ weight):
        return None
    asked = {"percent": 100 * rise[0] / usual[0, 1], "rise": common, "time": 1e3 / common, "count": len(tests)}
    return DAMPING_JUMP.ask(f"{now[0, 0]:.0f} Hz", **asked)


def _estimate_spread(series: Sequence[Floats]) -> tuple[float, float]:
    """Return the relative standard deviation of decay rates in series, shape (..., tests), and degrees of freedom."""
    series = [values for values in series if values.size]
    squares = sum(float(np.sum((values / np.mean(values, axis=-1, keepdims=True) - 1) ** 2)) for values in series)
    freedom = N_PRIOR_DAMPINGS + sum(values.size - values.size // values.shape[-1] for values in series)
    return math.sqrt((squares + N_PRIOR_DAMPINGS * DAMPING_STD**2) / freedom), freedom


def _student_limit(freedom: float) -> float:
    """Return the value of Student's distribution that is as unlikely as N_STD_WINDOW standard deviations."""
    return math.sqrt(freedom * math.expm1(N_STD_WINDOW**2 / (freedom + 1)))


def _trace(now: Floats, tests: Sequence[EarlierTest]) -> Floats:
    """Return the rows of the modes of tests that are nearest to those of a table; shape (tests, modes, 3)."""
    return np.array([_find(now[:, 0], _tabulate_test(test)) for test in tests]).reshape(-1, len(now), 3)


def _tabulate(modes: Sequence[Mode]) -> Floats:
    """Return frequency (Hz), decay rate (1/s) and peak of modes, the highest peak first; shape (n, 3)."""
    return _sort_table([(mode.frequency, mode.damping_ratio, mode.peak) for mode in modes])


def _tabulate_test(test: EarlierTest) -> Floats:
    """Return the table of the modes of an earlier test with a positive stiffness."""
    return _sort_table([(f, zeta, 1 / (2 * stiffness * zeta)) for f, zeta, stiffness, _ in test.modes if stiffness > 0])


def _sort_table(rows: Sequence[tuple[float, float, float]]) -> Floats:
    """Return the table of rows of frequency (Hz), damping ratio and peak."""
    table = [(f, 2 * math.pi * zeta * f, peak) for f, zeta, peak in rows]
    return np.array(sorted(table, key=lambda row: -row[2])).reshape(-1, 3)


def _select_strong(table: Floats) -> Floats:
    """Return the rows of the modes whose peak is near the highest."""
    return table[table[:, 2] >= MIN_PEAK_RATIO * table[:1, 2]] if table.size else table


def _find(frequencies: Floats, table: Floats) -> Floats:
    """Return the row of the mode nearest to each frequency, NaN without one near it; shape (n, columns of table)."""
    if not table.size:
        return np.full((frequencies.size, table.shape[1]), np.nan)
    distance = np.nan_to_num(np.abs(np.log(frequencies[:, np.newaxis] / table[:, 0])), nan=np.inf)
    is_near = np.min(distance, axis=1, keepdims=True) <= MAX_MATCH_CHANGE
    return np.where(is_near, table[np.argmin(distance, axis=1)], np.nan)
