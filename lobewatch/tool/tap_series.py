"""Series of tap tests: mounting, order, scatter and frequency drop."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import NamedTuple

import msgspec
import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import CROSS_TAP, UNKNOWN_CONDITIONS, Conditions, Remark
from lobewatch.machine import TapEntry

SERIES_CONDITIONS = {"stick_out_mm": ("stick-out", "{:g} mm"), "state": ("state", "{!r}")}
"""Conditions that divide series, each with its name and how a value is told."""


@dataclass(frozen=True)
class ToolMounting:
    """A tool as it is mounted in one series."""

    first: TapEntry
    """First tap test of the series."""
    conditions: Conditions
    """Conditions that were stated of it so far."""


class MountingTracker:
    """The series of tap tests that are shown in order of time; what nobody said divides none."""

    def __init__(self) -> None:
        """None yet."""
        self._mountings: dict[str, list[ToolMounting]] = {}
        """By tool, the current one last."""
        self._drawbar: dict[str, float] = {}
        self._hours: float | None = None

    def assign(self, tap: TapEntry) -> tuple[str, tuple[Remark, ...]]:
        """Identity of the first test of the series of a test, and what is to be said of it."""
        mountings = self._mountings.setdefault(tap.tool, [])
        if mountings and tap.conditions is UNKNOWN_CONDITIONS:
            return mountings[-1].first.id, ()
        remarks = [*self._check_drawbar(tap), *self._check_hours(tap)]
        current = mountings[-1] if mountings else None
        conditions = tap.conditions.with_defaults(current.conditions) if current else tap.conditions
        fitting = next(
            (mounting for mounting in reversed(mountings) if _is_same_mounting(mounting.conditions, conditions)), None
        )
        if current is not None and fitting is not current:
            remarks += [_mounting_change_remark(current, conditions, fitting)]
        if fitting is not None:
            mountings.remove(fitting)
            mountings.append(replace(fitting, conditions=conditions))
        else:
            mountings.append(ToolMounting(tap, conditions))
        return mountings[-1].first.id, tuple(remarks)

    def _check_drawbar(self, tap: TapEntry) -> Iterator[Remark]:
        now, before = tap.conditions.drawbar_kn, self._drawbar.get(tap.tool)
        if now is None:
            return
        self._drawbar[tap.tool] = now
        if before not in (None, now):
            text = f"drawbar force {now:g} kN, {before:g} kN before: the frequency may have changed with it"
            yield Remark("drawbar-changed", tap.tool, text, "where it was not meant, have the drawbar looked at")

    def _check_hours(self, tap: TapEntry) -> Iterator[Remark]:
        now, before = tap.conditions.hours, self._hours
        if now is None:
            return
        self._hours = now
        if before is not None and now < before:
            text = f"running hours {now:g} h, {before:g} h before: forecasts of a series that it is in count in days"
            yield Remark("hours-went-back", tap.tool, text, "exclude it and replay its file with the right --hours")


def _is_same_mounting(first: Conditions, second: Conditions) -> bool:
    """Whether they differ in nothing that is stated of both and divides."""
    return not _differing_conditions(first, second)


def _differing_conditions(first: Conditions, second: Conditions) -> list[str]:
    stated, also_stated = first.specified, second.specified
    return [
        name
        for name in SERIES_CONDITIONS
        if name in stated and name in also_stated and stated[name] != also_stated[name]
    ]


def _mounting_change_remark(before: ToolMounting, now: Conditions, earlier: ToolMounting | None) -> Remark:
    """Remark on a tool that is mounted otherwise than before; earlier: its series, where it was mounted so once."""
    changed = {name: SERIES_CONDITIONS[name] for name in _differing_conditions(before.conditions, now)}
    change = ", ".join(
        f"{label} {value.format(getattr(now, name))} after {value.format(getattr(before.conditions, name))}"
        for name, (label, value) in changed.items()
    )
    if earlier is None:
        return Remark("new-series", before.first.tool, f"{change}: a new series, compared with no test before it")
    since = datetime.fromisoformat(earlier.first.time)
    return Remark("earlier-series", before.first.tool, f"{change}: compared with the series begun {since:%Y-%m-%d}")


class TapPlace(msgspec.Struct, frozen=True, gc=False):
    """One tap test among all of a machine."""

    number: int
    """Number from 0, the oldest."""
    entry: TapEntry
    """Tap test as it stands in the journal."""
    previous: int | None
    """Place of the one before it of the same series and direction."""
    other_direction: int | None
    """Place of the newest one before it of the same series in another direction, x or y."""
    baseline: datetime | None = None
    """The event before it from which on all comparing begins anew; nothing before that is built on."""
    series: str = ""
    """Identity of the first tap test of its series: of one tool with one stick-out in one state, both directions, since
    the baseline."""
    cross: int | None = None
    """Place of the newest cross tap of the same series, itself where it is; None without any."""
    remarks: tuple[Remark, ...] = ()
    """Remarks where the series or the drawbar force is not that of the test before."""


class TapOrder:
    """The places of tap tests that are shown in order of time."""

    def __init__(self, baselines: Sequence[datetime] = ()) -> None:
        """baselines: oldest first. None is shown yet."""
        self.places: list[TapPlace] = []
        """Places of those that were shown."""
        self._baselines = baselines
        self._newest: dict[str, dict[str, int]] = {}
        self._mountings = MountingTracker()

    def add(self, tap: TapEntry) -> None:
        """The next one."""
        number, baseline = len(self.places), _find_baseline(tap, self._baselines) if self._baselines else None
        if self.places and self.places[-1].baseline != baseline:
            self._newest, self._mountings = {}, MountingTracker()
        series, remarks = self._mountings.assign(tap)
        newest = self._newest.setdefault(series, {})
        across = None
        for direction, place in newest.items():
            if direction not in (tap.direction, CROSS_TAP) and (across is None or place > across):
                across = place
        before = newest.get(tap.direction)
        newest[tap.direction] = number
        self.places.append(TapPlace(number, tap, before, across, baseline, series, newest.get(CROSS_TAP), remarks))


def order_taps(taps: Iterable[TapEntry], baselines: Sequence[datetime] = ()) -> list[TapPlace]:
    """taps, baselines: oldest first."""
    order = TapOrder(baselines)
    for tap in taps:
        order.add(tap)
    return order.places


def _find_baseline(tap: TapEntry, baselines: Sequence[datetime]) -> datetime | None:
    time = datetime.fromisoformat(tap.time)
    return next((baseline for baseline in reversed(baselines) if baseline <= time), None)


def iterate_earlier(place: TapPlace, among: Sequence[TapPlace]) -> Iterator[int]:
    """Numbers of the tap tests of the same series and direction before it, the newest first."""
    while place.previous is not None:
        place = among[place.previous]
        yield place.number


MIN_TAPS_FOR_SCATTER = 8
"""Number of tap tests from which on a series tells its own scatter."""
MAX_TAPS_FOR_DROP_RATE = 12
"""Largest number of tap tests that the rate of the fall is taken from; three at least."""


class FollowedMode(NamedTuple):
    """The mode followed in one tap test."""

    time: datetime
    """Time of the tap test."""
    frequency: float
    """Natural frequency (Hz)."""
    damping_ratio: float
    """Damping ratio (-)."""
    stiffness: float
    """Modal stiffness (N/m); NaN where no force was measured."""
    phase_deg: float = 0.0
    """Phase of the modal constant (degrees)."""


class Scatter(NamedTuple):
    """Half-widths that 95 % of tap tests stay within of the next, relative but for the phase."""

    frequency: float
    """Half-width of the natural frequency."""
    damping_ratio: float
    """Half-width of the damping ratio."""
    stiffness: float
    """Half-width of the stiffness."""
    phase_deg: float = 0.0
    """Half-width of the phase of the modal constant (degrees)."""


def compute_scatter(series: Sequence[FollowedMode]) -> Scatter | None:
    """Scatter from the steps between neighbours, so that a slow fall does not count; None below 8 tap tests that know
    the stiffness."""
    known = [point for point in series if math.isfinite(point.stiffness)]
    if len(known) < MIN_TAPS_FOR_SCATTER:
        return None
    values = np.array([point[1:] for point in known])
    values[:, :3] = np.log(values[:, :3])
    return Scatter(*_half_widths(values).tolist())


def compute_frequency_scatter(series: Sequence[FollowedMode]) -> float | None:
    """Half-width that 95 % of natural frequencies stay within of the next, relative; None below 8 tap tests."""
    if len(series) < MIN_TAPS_FOR_SCATTER:
        return None
    return float(_half_widths(np.log([[point.frequency] for point in series]))[0])


def _half_widths(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half-widths of 95 % from the steps between neighbours; values of shape (n, k)."""
    steps = np.diff(values, axis=0)
    return np.asarray(np.std(steps, axis=0, ddof=1) / np.sqrt(2) * scipy.special.stdtrit(len(steps) - 1, 0.975))


def expected_frequency_drop(series: Sequence[FollowedMode], days: float) -> float | None:
    """Relative fall of the frequency within so many days at the rate of the last tests; None where it is not known.

    A rise counts as none.
    """
    recent = series[-MAX_TAPS_FOR_DROP_RATE:]
    if len(recent) < 3:
        return None
    at = np.array([(point.time - recent[0].time) / timedelta(days=1) for point in recent])
    if np.ptp(at) == 0:
        return None
    slope = np.polyfit(at - at.mean(), np.log([point.frequency for point in recent]), 1)[0]
    return float(max(-slope * days, 0.0))


def interpolate_frequency(series: Sequence[FollowedMode], time: datetime) -> float | None:
    """Natural frequency (Hz) at a time, linear between the tests before and after; None before the first."""
    behind = bisect_right(series, time, key=lambda point: point.time)
    if not behind:
        return None
    near = series[behind - 1 : behind + 1]
    times = [point.time.timestamp() for point in near]
    return float(np.interp(time.timestamp(), times, [point.frequency for point in near]))
