"""Series of tap tests: mounting, order, scatter and frequency drop."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import partial
from typing import Any, NamedTuple

import msgspec
import numpy as np
import scipy

from acquisition import CROSS_TAP, UNKNOWN_CONDITIONS, Conditions, Remark
from lobewatch.arrays import Floats
from lobewatch.machine import TapEntry
from lobewatch.machine.settings.display_units import LENGTH

SERIES_CONDITIONS: dict[str, tuple[str, Callable[[Any], str]]] = {
    "stick_out_mm": ("stick-out", partial(LENGTH.text, form="g")),
    "state": ("state", repr),
}
"""Conditions that begin a new series, with label and function that formats a value."""


@dataclass(frozen=True)
class ToolMounting:
    """Mounting of a tool in one series."""

    first: TapEntry
    """First tap test of the series."""
    conditions: Conditions
    """Conditions stated so far."""


class MountingTracker:
    """Assigns tap tests in order of time to series; unstated conditions begin none."""

    def __init__(self) -> None:
        self._mountings: dict[str, list[ToolMounting]] = {}
        """By tool, the current one last."""
        self._drawbar: dict[str, float] = {}
        self._hours: float | None = None

    def assign(self, tap: TapEntry) -> tuple[str, tuple[Remark, ...]]:
        """Return the first test of the series of a tap test, and remarks on changes."""
        mountings = self._mountings.setdefault(tap.tool, [])
        if mountings and tap.conditions == UNKNOWN_CONDITIONS:
            return mountings[-1].first.id, ()
        remarks = [*self._check_values(tap)]
        current = mountings[-1] if mountings else None
        conditions = tap.conditions.with_defaults(current.conditions) if current else tap.conditions
        same = (old for old in reversed(mountings) if not _differing_conditions(old.conditions, conditions))
        fitting = next(same, None)
        if current is not None and fitting is not current:
            remarks += [_mounting_change_remark(current, conditions, fitting)]
        if fitting is not None:
            mountings.remove(fitting)
            mountings.append(replace(fitting, conditions=conditions))
        else:
            mountings.append(ToolMounting(tap, conditions))
        return mountings[-1].first.id, tuple(remarks)

    def _check_values(self, tap: TapEntry) -> Iterator[Remark]:
        """Yield remarks on a changed drawbar force and on fewer running hours than before."""
        force, hours = tap.conditions.drawbar_kn, tap.conditions.hours
        last_force, last_hours = self._drawbar.get(tap.tool), self._hours
        if force is not None:
            self._drawbar[tap.tool] = force
            if last_force not in (None, force):
                text = f"drawbar force changed from {last_force:g} kN to {force:g} kN, so f1 may have changed"
                yield Remark("drawbar-changed", tap.tool, text, "Inspect the drawbar if the change was not intended")
        if hours is not None:
            self._hours = hours
            if last_hours is not None and hours < last_hours:
                cure = "Exclude the tap test and replay its file with the correct Conditions.hours"
                text = (
                    f"running hours dropped from {last_hours:g} h to {hours:g} h, so forecasts of this series use days"
                )
                yield Remark("hours-went-back", tap.tool, text, cure)


def _differing_conditions(first: Conditions, second: Conditions) -> list[str]:
    values, others = first.specified, second.specified
    return [name for name in SERIES_CONDITIONS if name in values and name in others and values[name] != others[name]]


def _mounting_change_remark(before: ToolMounting, now: Conditions, earlier: ToolMounting | None) -> Remark:
    """Return the remark on a changed mounting; earlier: former series with that mounting."""
    changed = {name: SERIES_CONDITIONS[name] for name in _differing_conditions(before.conditions, now)}
    change = ", ".join(
        f"{label} {show(getattr(now, name))} after {show(getattr(before.conditions, name))}"
        for name, (label, show) in changed.items()
    )
    if earlier is None:
        return Remark("new-series", before.first.tool, f"{change} begins a new series, not compared with earlier tests")
    begun = f"compared with the series of {earlier.first.created:%Y-%m-%d}"
    return Remark("earlier-series", before.first.tool, f"{change}, {begun}")


class TapPlace(msgspec.Struct, frozen=True, gc=False):
    """Tap test with its place among all of a machine."""

    number: int
    """Number from 0, oldest first."""
    entry: TapEntry
    """Journal entry."""
    previous: int | None
    """Number of the previous test of the same series and direction."""
    other_direction: int | None
    """Number of the newest earlier test of the same series in the other direction, x or y."""
    baseline: datetime | None = None
    """Newest baseline before it; earlier tests are not compared."""
    series: str = ""
    """Identity of the first tap test of its series: same tool, stick-out, state and baseline, both directions."""
    cross: int | None = None
    """Number of the newest cross FRF of the same series, itself included; None without one."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on a new series or a changed drawbar force."""


class TapOrder:
    """Places of tap tests in order of time; baselines and taps: oldest first."""

    def __init__(self, baselines: Sequence[datetime] = (), taps: Iterable[TapEntry] = ()) -> None:
        self.places: list[TapPlace] = []
        """Places of those that were shown."""
        self._baselines = baselines
        self._newest: dict[str, dict[str, int]] = {}
        self._mountings = MountingTracker()
        for tap in taps:
            self.add(tap)

    def add(self, tap: TapEntry) -> None:
        """Add the next tap test."""
        number, baselines = len(self.places), reversed(self._baselines)
        baseline = next((baseline for baseline in baselines if baseline <= tap.created), None)
        if self.places and self.places[-1].baseline != baseline:
            self._newest, self._mountings = {}, MountingTracker()
        series, remarks = self._mountings.assign(tap)
        newest = self._newest.setdefault(series, {})
        others = (place for direction, place in newest.items() if direction not in (tap.direction, CROSS_TAP))
        before, across = newest.get(tap.direction), max(others, default=None)
        newest[tap.direction] = number
        self.places.append(TapPlace(number, tap, before, across, baseline, series, newest.get(CROSS_TAP), remarks))


def iterate_earlier(place: TapPlace, among: Sequence[TapPlace]) -> Iterator[int]:
    """Yield the numbers of the earlier tests of the same series and direction, newest first."""
    while place.previous is not None:
        place = among[place.previous]
        yield place.number


MIN_TAPS_FOR_SCATTER = 8
"""Smallest number of tap tests for the scatter of a series."""
MAX_TAPS_FOR_DROP_RATE = 12
"""Largest number of tap tests for the rate of the frequency drop; the smallest is 3."""


class FollowedMode(NamedTuple):
    """Followed mode of one tap test."""

    time: datetime
    """Time of the tap test."""
    frequency: float
    """Natural frequency (Hz)."""
    damping_ratio: float
    """Damping ratio (-)."""
    stiffness: float
    """Modal stiffness (N/m); NaN without force."""
    phase_deg: float = 0.0
    """Phase of the modal constant (degrees)."""


class Scatter(NamedTuple):
    """Half-widths of 95 % between successive tap tests, relative except for the phase."""

    frequency: float
    """Half-width of the natural frequency."""
    damping_ratio: float
    """Half-width of the damping ratio."""
    stiffness: float
    """Half-width of the stiffness."""
    phase_deg: float = 0.0
    """Half-width of the phase of the modal constant (degrees)."""


def compute_scatter(series: Sequence[FollowedMode]) -> Scatter | None:
    """Compute the scatter from successive differences, so that a slow drop does not count.

    None below 8 tap tests with stiffness.
    """
    known = [point for point in series if math.isfinite(point.stiffness)]
    if len(known) < MIN_TAPS_FOR_SCATTER:
        return None
    values = np.array([point[1:] for point in known])
    values[:, :3] = np.log(values[:, :3])
    return Scatter(*_half_widths(values).tolist())


def compute_frequency_scatter(series: Sequence[FollowedMode]) -> float | None:
    """Compute the relative half-width of 95 % of the frequency between successive tests; None below 8 tests."""
    if len(series) < MIN_TAPS_FOR_SCATTER:
        return None
    return float(_half_widths(np.log([[point.frequency] for point in series]))[0])


def _half_widths(values: Floats) -> Floats:
    """Return the half-widths of 95 % from successive differences of values, shape (n, k)."""
    steps = np.diff(values, axis=0)
    return np.asarray(np.std(steps, axis=0, ddof=1) / np.sqrt(2) * scipy.special.stdtrit(len(steps) - 1, 0.975))


def expected_frequency_drop(series: Sequence[FollowedMode], days: float) -> float | None:
    """Return the relative frequency drop within some days at the recent rate; None if unknown, 0 for a rise."""
    recent = series[-MAX_TAPS_FOR_DROP_RATE:]
    if len(recent) < 3:
        return None
    at = np.array([(point.time - recent[0].time) / timedelta(days=1) for point in recent])
    if np.ptp(at) == 0:
        return None
    slope = np.polyfit(at - at.mean(), np.log([point.frequency for point in recent]), 1)[0]
    return float(max(-slope * days, 0.0))


def interpolate_frequency(series: Sequence[FollowedMode], time: datetime) -> float | None:
    """Interpolate the natural frequency (Hz) at a time; None before the first test."""
    behind = bisect_right(series, time, key=lambda point: point.time)
    if not behind:
        return None
    near = series[behind - 1 : behind + 1]
    times = [point.time.timestamp() for point in near]
    return float(np.interp(time.timestamp(), times, [point.frequency for point in near]))
