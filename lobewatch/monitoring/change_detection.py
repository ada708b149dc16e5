"""Detect drops and rises in a series with a change-point model.

Hawkins, Qiu & Kang (2003), "The changepoint model for statistical process control", Journal of Quality Technology
35(4), one-sided, with changes of slope in addition to steps.

Two consecutive points that are sure of a drop trigger an alarm; four consecutive unsure points close it. Nothing else
does: no rise, and nothing that was done to the machine. A sure rise restarts the monitor at the point that was sure
of it, for among the lower points before no drop would be seen any more. (From where it seems to have risen, chance
rises would begin it at their highest points, and a third of them would end as a drop.) An alarm that is open goes on
to be evaluated by its own monitor.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.monitoring.alarm_estimate import SeriesChange, estimate_drop
from lobewatch.monitoring.level_model import LevelModel, build_level_model
from lobewatch.monitoring.series_points import Readings

MIN_MONITORED_POINTS = 9
"""Smallest number of points for an evaluation; chosen."""
MIN_POINTS_WITH_PRIOR = 5
"""Smallest number of points for an evaluation if a scatter prior is known; chosen."""
SURE_CHANGE_SCORE = 3.3
"""Score from which a change is certain; chance of 1 in 2000 if only the last point is checked."""
SURE_FIRST_STEP_SCORE = 2.6
"""Score from which a step after the first point is certain; chosen.

It is one comparison for the whole series and not one more with each point, so that its probability has a larger
weight (Genovese, Roeder & Wasserman 2006, "False discovery control with p-value weighting", Biometrika 93(3))."""
MIN_FIRST_STEP_POINTS = 36
"""Smallest number of points for that score, so that the comparison changes little with each further point; chosen."""
MIN_SHARED_CHANGE = 0.5
"""Smallest share of the change of a mean of two series that one of them must show; chosen."""
SCORE_BLOCK_ROWS = 64
"""Number of points evaluated at once, which limits memory."""

MonitoredKind = Literal["step", "slope"]
"""Kind of a change that the monitor looks for."""
MIN_POINTS_AROUND_CHANGE: dict[MonitoredKind, tuple[int, int]] = {"step": (2, 2), "slope": (1, 3)}
"""Smallest number of points before and after a change of each kind."""


class LikeliestChange(NamedTuple):
    """Likeliest change for several lengths of the series, shape (r,)."""

    score: Floats
    """Score: misfit of a steady series as a normal quantile, shape (r,)."""
    is_step: Flags
    """True for each change that is a step, shape (r,)."""
    point: Indices
    """Index of the point of each change as in `SeriesChange`, shape (r,)."""


@dataclass(frozen=True, eq=False)
class ChangeMonitor:
    """Monitor that evaluates the points of a series in turn."""

    level_model: LevelModel
    """Level model of the fits."""
    change: LikeliestChange
    """Likeliest change up to each point; the score is NaN for the first points, which are not evaluated."""
    sign: int
    """1 to detect drops, -1 to detect rises."""

    @property
    def scores(self) -> Floats:
        """Score of each point, a normal quantile, shape (n,); NaN before the first evaluated point."""
        return self.change.score

    @cached_property
    def is_sure(self) -> Flags:
        """True for each point with a certain change, shape (n,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.scores >= SURE_CHANGE_SCORE)

    @property
    def first_alarm(self) -> int | None:
        """Index of the second of the first two consecutive points with a certain change; None without these."""
        return next(self.alarms_from(0), None)

    def alarms_from(self, first: int) -> Iterator[int]:
        """Return the points from one on that are sure of a change, as the ones before them are."""
        begin = max(first, 1)
        return (begin + int(i) for i in np.flatnonzero(self.is_sure[begin:] & self.is_sure[begin - 1 : -1]))

    def change_at(self, alarm: int) -> SeriesChange:
        """Return the change that a point is sure of: kind and beginning as of then, size by all points."""
        return _fit_change(self.level_model, self.change, alarm, self.sign)


def find_newest_change(y: Floats) -> SeriesChange | None:
    """Find the drop, or with a negative size the rise, that the last two points (n,) are sure of, or None."""
    if y.size <= MIN_MONITORED_POINTS:
        return None
    base = build_level_model(Readings(y))
    for sign, change in zip((1, -1), _find_likeliest_changes(base, np.arange(y.size - 2, y.size)), strict=True):
        if (change.score >= SURE_CHANGE_SCORE).all():
            drop = _fit_change(base, change, -1, sign)
            return drop._replace(size=sign * drop.size)
    return None


def monitor_drops(readings: Readings) -> ChangeMonitor:
    """Monitor a series for drops, point by point."""
    return monitor_drops_and_rises(readings)[0]


def monitor_drops_and_rises(readings: Readings) -> tuple[ChangeMonitor, ChangeMonitor]:
    """Monitor a series for drops, and its mirror image for rises.

    Check the mean of both directions as well as the single direction.
    """
    base, shared = build_level_model(readings), readings.shared_points
    common = build_level_model(readings.mean_of_directions)
    pairs = zip(_score_points(base), _score_points(common), strict=True)
    drops, rises = (_merge_directions(base, alone, common, together, shared) for alone, together in pairs)
    drops, rises = _add_first_step(base, drops, 1), _add_first_step(base, rises, -1)
    return ChangeMonitor(base, drops, 1), ChangeMonitor(base, rises, -1)


def _score_points(base: LevelModel) -> tuple[LikeliestChange, LikeliestChange]:
    """Find the likeliest drop and rise up to each point."""
    first = MIN_POINTS_WITH_PRIOR if base.scatter_prior.freedom else MIN_MONITORED_POINTS
    n, last = base.y.size, np.arange(first - 1, base.y.size)
    drops, rises = (LikeliestChange(np.full(n, np.nan), np.zeros(n, np.bool_), np.zeros(n, np.intp)) for _ in range(2))
    if last.size:
        for every, judged in zip((drops, rises), _find_likeliest_changes(base, last), strict=True):
            for values, part in zip(every, judged, strict=True):
                values[last] = part
    return drops, rises


def _merge_directions(
    base: LevelModel, alone: LikeliestChange, common: LevelModel, together: LikeliestChange, shared: Indices
) -> LikeliestChange:
    """Merge the change of one direction with that of the mean of both, whichever is surer.

    shared: points of the series that the mean has. Two checks double the chance of a false alarm.
    """
    n = np.flatnonzero(np.isfinite(together.score)) + 1
    last, fell, middle = shared[n - 1], together.is_step[n - 1], together.point[n - 1]
    own, mean = base.change_sizes(fell, last + 1, shared[middle]), common.change_sizes(fell, n, middle)
    counts = (own * mean >= MIN_SHARED_CHANGE * mean**2) & ~(together.score[n - 1] <= alone.score[last])
    merged = LikeliestChange(alone.score.copy(), alone.is_step.copy(), alone.point.copy())
    for values, part in zip(merged, (together.score[n - 1], fell, shared[middle]), strict=True):
        values[last[counts]] = part[counts]
    merged.score[last] = -scipy.special.ndtri(np.minimum(2 * scipy.special.ndtr(-merged.score[last]), 1.0))
    return merged


def _find_likeliest_changes(base: LevelModel, last: Indices) -> tuple[LikeliestChange, LikeliestChange]:
    """Find the likeliest drop and rise up to each of these consecutive points."""
    begins = range(SCORE_BLOCK_ROWS, last.size, SCORE_BLOCK_ROWS)
    blocks = [_find_largest_changes(base, block + 1) for block in np.split(last, begins)]
    points, leans = (np.concatenate(parts, axis=2) for parts in zip(*blocks, strict=True))
    drop, rise = (_choose_likeliest(base, last + 1, points[i], sign * leans[i]) for i, sign in enumerate((-1, 1)))
    return drop, rise


def _add_first_step(base: LevelModel, change: LikeliestChange, sign: int) -> LikeliestChange:
    """Add the step after the first point where it is certain."""
    n = np.arange(MIN_FIRST_STEP_POINTS, base.y.size + 1)
    if not n.size:
        return change
    step = _score_leans(base, -sign * base.explained_root("step", n[:, np.newaxis], np.array([1]))[:, 0], n)
    score = step + SURE_CHANGE_SCORE - SURE_FIRST_STEP_SCORE
    last = (n - 1)[(step >= SURE_FIRST_STEP_SCORE) & (score > change.score[n - 1])]
    change.score[last], change.is_step[last], change.point[last] = score[last - n[0] + 1], True, 1
    return change


def _score_leans(base: LevelModel, lean: Floats, n: Indices) -> Floats:
    """Return Student's t of changes by their signed roots of explained squares in the first n (r,), as a quantile."""
    t = lean / np.sqrt(base.point_variance(lean**2, n))
    return np.asarray(-scipy.special.ndtri(scipy.special.stdtr(base.freedom(n), -t)))


def _find_largest_changes(base: LevelModel, n: Indices) -> tuple[Indices, Floats]:
    """Find where a drop and a rise of each kind explain most in the first n (r,), shape (2, 2, r) each."""
    k, rows = np.arange(n[-1]), np.arange(n.size)
    points, leans = np.empty((2, 2, n.size), np.intp), np.empty((2, 2, n.size))
    for number, (kind, (before, behind)) in enumerate(MIN_POINTS_AROUND_CHANGE.items()):
        lean = base.explained_root(kind, n[:, np.newaxis], k)
        outside = k[n[0] - behind :] > n[:, np.newaxis] - behind
        for side, (worst, farthest) in enumerate(((np.inf, np.argmin), (-np.inf, np.argmax))):
            np.copyto(lean[:, n[0] - behind :], worst, where=outside)
            lean[:, :before] = worst
            points[side, number] = farthest(lean, axis=1)
            leans[side, number] = lean[rows, points[side, number]]
    return points, leans


def _choose_likeliest(base: LevelModel, n: Indices, points: Indices, leans: Floats) -> LikeliestChange:
    """Choose the likelier of a step and a slope in the first n (r,) points."""
    step, slope = (_score_leans(base, lean, n) for lean in leans)
    fell = step >= slope
    return LikeliestChange(np.maximum(step, slope), fell, np.where(fell, points[0], points[1]))


def _fit_change(base: LevelModel, change: LikeliestChange, at: int, sign: int) -> SeriesChange:
    """Fit the change up to one of the points to the whole series; at: index of that point."""
    kind: MonitoredKind = "step" if change.is_step[at] else "slope"
    n, point = base.y.size, int(change.point[at])
    beta, error = base.fit_change(kind, n, point)
    length = n - 1 - point if kind == "slope" else 1
    student = float(scipy.special.stdtrit(base.freedom(np.array([n]))[0], 0.975))
    return SeriesChange(kind, point, -sign * beta * length, error * length * student)


N_CLOSING_POINTS = 4
"""Number of consecutive points without a certain drop that close an alarm; chosen."""


@dataclass(frozen=True, eq=False)
class DetectedDrop:
    """Drop that has triggered an alarm; points by their index in the series."""

    triggered_at: int
    """Point that triggered it, the second consecutive certain one."""
    closed_at: int | None
    """Point that closed it; None while it is open."""
    begin: int
    """First point of the monitor that detected it."""
    readings: Readings
    """Series from there on."""

    @cached_property
    def change(self) -> SeriesChange:
        """Kind, beginning and size of the drop, as all points from there on tell."""
        change = estimate_drop(self.readings)
        return change._replace(point=self.begin + change.point)


class Detection(NamedTuple):
    """Changes detected in a series."""

    scores: Floats
    """Score of each point in the monitor of its time, shape (n,); NaN for the first 8 points of a monitor."""
    drops: tuple[DetectedDrop, ...]
    """Drops that have triggered an alarm, oldest first."""
    rise: SeriesChange | None
    """Newest certain rise with a positive size, which restarted the monitor; None if there is none."""

    @property
    def open_drops(self) -> tuple[DetectedDrop, ...]:
        """Drops with an open alarm."""
        return tuple(drop for drop in self.drops if drop.closed_at is None)

    @property
    def needs_repeat(self) -> bool:
        """True if only the newest point shows a certain drop."""
        return not self.open_drops and self.scores.size > 0 and bool(self.scores[-1] >= SURE_CHANGE_SCORE)


def detect_changes(readings: Readings) -> Detection:
    """Detect all drops, and the newest rise, in a series."""
    count = readings.y.size
    scores, drops, rise = np.full(count, np.nan), list[DetectedDrop](), None
    begin = judged = 0
    while judged < count:
        down, up = monitor_drops_and_rises(readings.since(begin))
        risen = up.first_alarm
        end = count if risen is None else begin + risen + 1
        scores[judged:end] = down.scores[judged - begin : end - begin]
        drops += _find_drops(down, readings.since(begin), begin, judged, end)
        judged = end
        if risen is not None:
            seen = up.change_at(risen)
            rise, begin = seen._replace(point=begin + seen.point), begin + risen
    return Detection(scores, tuple(drops), rise)


def _find_drops(watch: ChangeMonitor, readings: Readings, begin: int, first: int, end: int) -> Iterator[DetectedDrop]:
    """Find the drops that a monitor triggers an alarm for between two points."""
    raised = next(watch.alarms_from(first - begin), None)
    while raised is not None and begin + raised < end:
        closed = _find_closing_point(watch, raised)
        yield DetectedDrop(begin + raised, None if closed is None else begin + closed, begin, readings)
        raised = None if closed is None else next(watch.alarms_from(closed + 1), None)


def _find_closing_point(watch: ChangeMonitor, raised: int) -> int | None:
    """Find the point that closes an alarm."""
    calm = 0
    for point in range(raised + 1, watch.scores.size):
        calm = 0 if watch.is_sure[point] else calm + 1
        if calm == N_CLOSING_POINTS:
            return point
    return None
