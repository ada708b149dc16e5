"""Calibrate the damping of bearings to one measured damping ratio."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from dsm.arrays import Floats, require_number
from dsm.calibration.report_text import format_with_error
from dsm.calibration.stiffness_groups import calibrated_bearings
from dsm.modes.damped_modes import DampedMode, DampedShaft
from dsm.spindle.attachments import Damping, damping_of_bearings
from dsm.spindle.spindle import Spindle

FIRST_DAMPER_STEP = 0.3
"""Longest first step: share of the damper in the force of its spring (-), far from locking the bearing."""
MAX_DAMPER_GROWTH = 0.5
"""Longest later step, over the dampers: the damping ratio may fall and rise again."""
MAX_DAMPER_SHARE = 3e3
"""Largest searched share of the damper in the force of its spring."""
MAX_DAMPING_STEPS = 100
"""Most steps towards the measured damping ratio."""


class UnreachableDampingError(ValueError):
    """Raised if no dampers give the mode the measured damping ratio.

    Parameters
    ----------
    message : str
        Text of the error.
    limit : float
        Least or largest damping ratio that the mode can have (-), whichever was passed.
    """

    def __init__(self, message: str, limit: float) -> None:
        super().__init__(message)
        self.limit = limit
        """Limit of the damping ratio (-)."""


@dataclass(frozen=True)
class DampingCalibration:
    """Spindle whose bearing dampers give a mode its measured damping ratio; str() gives a report."""

    damping_ratio: float
    """Measured damping ratio (-)."""
    damping_ratio_std: float | None
    """Standard error of the measured damping ratio (-); None if not given."""
    mode: int
    """Number of the mode; 1 is the lowest without damping."""
    frequency: float
    """Natural frequency |s|/2 pi of the mode with this damping (Hz)."""
    other_damping_ratio: float
    """Damping ratio of the mode without the calibrated dampers (-): from the loss factor and other bearings."""
    loss_factor: float
    """Loss factor of shaft, bearings, housing and joints (-)."""
    bearing_damping: float
    """Mean viscous damping of the calibrated bearings (N s/m)."""
    bearing_damping_std: float | None
    """Standard error of the bearing damping from that of the damping ratio (N s/m); None if not given."""
    sensitivity: float
    """Sensitivity d zeta / d ln c of the mode (-)."""
    given: Spindle
    """Spindle as given."""
    spindle: Spindle
    """Spindle with the dampers."""

    def __str__(self) -> str:
        """Return the report."""
        damping = format_with_error(self.bearing_damping, self.bearing_damping_std, unit="N s/m", percent=True)
        measured = format_with_error(self.damping_ratio, self.damping_ratio_std, unit="of critical", percent=True)
        other = f"{self.other_damping_ratio:.6g} without the calibrated damping, loss factor {self.loss_factor:g}"
        return (
            f"bearing damping  {damping} per bearing on average\n"
            f"from mode {self.mode}      damping ratio {measured}, {self.frequency:.6g} Hz\n"
            f"other damping    damping ratio {other}\n"
            f"sensitivity      1 % more bearing damping adds {self.sensitivity / 100:.3g} to the damping ratio"
        )


class _DampingPoint(NamedTuple):
    """Mode at one amount of the dampers."""

    amount: float
    mode: DampedMode
    slope: float
    """Slope d zeta / d amount."""


class _Dampers(NamedTuple):
    """Dampers in a fixed ratio that are varied, and all other damping."""

    shaft: DampedShaft
    number: int
    fixed: Damping
    ratio: Floats
    """Dampers (N s/m) of all bearings at amount 1, shape (n_bearings,)."""

    def at(self, amount: float) -> Damping:
        return Damping(self.fixed.viscous + amount * self.ratio, self.fixed.loss_factor)

    def point(self, amount: float, mode: DampedMode) -> _DampingPoint:
        """Return the point of a mode with d zeta = cos(arg w) Im(dw/w), as zeta = sin(arg w)."""
        change = complex(self.shaft.damper_sensitivity(self.at(amount), mode) @ self.ratio) / mode.w
        return _DampingPoint(amount, mode, mode.w.real / abs(mode.w) * change.imag)

    def follow(self, start: _DampingPoint, amount: float) -> _DampingPoint:
        mode = self.shaft.follow(self.number, start.mode, self.at(start.amount), self.at(amount))
        return self.point(amount, mode)


def calibrate_damping(
    spindle: Spindle,
    damping_ratio: float,
    damping_ratio_std: float | None = None,
    mode: int = 1,
    group: str | None = None,
    loss_factor: float = 0.0,
) -> DampingCalibration:
    """Give bearings viscous dampers, so that a mode has its measured damping ratio.

    If all bearings of the group have damping already, it keeps its ratio; if none has, the dampers are in the ratio of
    the
    stiffnesses. Other bearings keep their damping. The part of the loss factor in the damping ratio is subtracted
    exactly.
    Of two dampers that give the same ratio, a soft one and one that nearly locks the bearing, the soft one is taken.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    damping_ratio : float
        Measured damping ratio (-).
    damping_ratio_std : float, optional
        Standard error of the damping ratio (-).
    mode : int
        Number of the mode; 1 is the lowest.
    group : str, optional
        Group of bearings. Default: all bearings with a group.
    loss_factor : float
        Loss factor of the whole spindle (-), see damped_modes.

    Returns
    -------
    DampingCalibration
        Spindle with dampers.

    Raises
    ------
    UnreachableDampingError
        If other damping alone gives more than was measured, or no damper gives as much: one that is too strong locks
        the bearing and damps nothing.
    ValueError
        For a damping ratio outside 0 to 1, damping given to a part of the bearings only, a group with no bearing or
        a rigid one, and an unsupported shaft.

    Examples
    --------
    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> damped = calibrate_damping(spindle, 0.03, damping_ratio_std=0.003)
    >>> f"{damped.bearing_damping:.0f} +- {damped.bearing_damping_std:.0f} N s/m"
    '2655 +- 265 N s/m'
    >>> damped_modes(damped.spindle, 1).damping_ratio.round(6).tolist()
    [0.03]
    """
    _check_damping(damping_ratio, damping_ratio_std, mode)
    chosen = calibrated_bearings(spindle, group)
    given = damping_of_bearings(spindle.bearings, loss_factor)
    fixed = given.viscous.copy()
    fixed[chosen] = 0.0
    shaft = DampedShaft.of(spindle, mode)
    dampers = _Dampers(shaft, mode, Damping(fixed, loss_factor), _start_dampers(spindle, chosen))
    start = dampers.point(0.0, shaft.follow(mode, shaft.start(mode), shaft.no_damping, dampers.fixed))
    damped = _find_damping(dampers, start, damping_ratio)
    viscous = dampers.at(damped.amount).viscous
    mean, per_amount = float(np.mean(viscous[chosen])), float(np.mean(dampers.ratio[chosen]))
    bearings = [replace(b, damping=float(c)) for b, c in zip(spindle.bearings, viscous, strict=True)]
    return DampingCalibration(
        damping_ratio=damping_ratio,
        damping_ratio_std=damping_ratio_std,
        mode=mode,
        frequency=abs(damped.mode.w) / (2 * math.pi),
        other_damping_ratio=start.mode.damping_ratio,
        loss_factor=loss_factor,
        bearing_damping=mean,
        bearing_damping_std=None if damping_ratio_std is None else per_amount * damping_ratio_std / damped.slope,
        sensitivity=damped.slope * damped.amount,
        given=spindle,
        spindle=replace(spindle, bearings=bearings),
    )


def _check_damping(damping_ratio: float, damping_ratio_std: float | None, mode: int) -> None:
    if not 0 < damping_ratio < 1:
        raise ValueError(f"damping_ratio={damping_ratio} is not between 0 and 1")
    require_number("damping_ratio_std", damping_ratio_std)
    if mode < 1:
        raise ValueError(f"mode={mode} is not at least 1, the lowest")


def _start_dampers(spindle: Spindle, chosen: list[int]) -> Floats:
    """Return the given dampers, or dampers with damper over stiffness of 1 us in each bearing."""
    bearings = [spindle.bearings[index] for index in chosen]
    damped = [bearing for bearing in bearings if bearing.damping > 0]
    if damped and len(damped) < len(chosen):
        raise ValueError(
            f"only {len(damped)} of {len(chosen)} bearings to calibrate have a damping. Give a damping for every "
            "bearing, or for none: it is then distributed in proportion to stiffness."
        )
    ratio = np.zeros(len(spindle.bearings))
    ratio[chosen] = [bearing.damping if damped else 1e-6 * bearing.stiffness for bearing in bearings]
    return ratio


def _find_damping(dampers: _Dampers, start: _DampingPoint, target: float) -> _DampingPoint:
    """Find the weakest dampers with the damping ratio `target`."""
    without_dampers = start.mode.damping_ratio
    if without_dampers >= target:
        raise UnreachableDampingError(
            f"damping_ratio={target:g} of mode {dampers.number} is not above {without_dampers:.6g}, the ratio without "
            "the damping to calibrate. Reduce loss_factor or the damping of other bearings, or check the measurement.",
            without_dampers,
        )
    low, high = _bracket_target(dampers, start, target)
    ends, close = (low.amount, high.amount), {"xtol": 1e-15 * high.amount, "rtol": 1e-13}
    root = scipy.optimize.brentq(lambda v: dampers.follow(low, v).mode.damping_ratio - target, *ends, **close)
    return dampers.follow(low, root)


def _bracket_target(dampers: _Dampers, low: _DampingPoint, target: float) -> tuple[_DampingPoint, _DampingPoint]:
    """Return two points with the target between them; of several humps, on the first that is high enough."""
    springs = np.array([bearing.stiffness for bearing in dampers.shaft.spindle.bearings])
    unit = 1 / (abs(low.mode.w) * float(np.max(dampers.ratio / springs)))
    longest, most = math.inf, low.mode.damping_ratio
    for _ in range(MAX_DAMPING_STEPS):
        if low.amount > MAX_DAMPER_SHARE * unit:
            break
        # Twice the Newton step, which is too short if the curve bends down.
        newton = 2 * (target - low.mode.damping_ratio) / low.slope if low.slope > 0 else math.inf
        step = min(newton, max(FIRST_DAMPER_STEP * unit, MAX_DAMPER_GROWTH * low.amount), longest)
        try:
            high = dampers.follow(low, low.amount + step)
        except ArithmeticError:
            longest = step / 2
            continue
        top = _find_maximum(dampers, low, high) if low.slope > 0 >= high.slope else high
        if top.mode.damping_ratio >= target:
            return low, top
        low, most = high, max(most, top.mode.damping_ratio)
    raise UnreachableDampingError(
        f"damping_ratio={target:g} of mode {dampers.number} is above {most:.4g}, the maximum with these bearings. "
        "Increase loss_factor, or check the measurement.",
        most,
    )


def _find_maximum(dampers: _Dampers, low: _DampingPoint, high: _DampingPoint) -> _DampingPoint:
    """Find the largest damping ratio between a point with rising and one with falling slope."""
    ends = low.amount, high.amount
    return dampers.follow(low, scipy.optimize.brentq(lambda v: dampers.follow(low, v).slope, *ends, rtol=1e-10))
