"""Result of a stiffness calibration, with the remaining preload."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from dsm.calibration.least_squares import MIN_ENERGY_SHARE
from dsm.calibration.report_text import FitRemark, format_with_error
from dsm.calibration.stiffness_groups import scale_parts
from dsm.modes.natural_frequencies import modal_stiffness, natural_frequencies
from dsm.response import static_stiffness
from dsm.spindle.attachments import Bearing
from dsm.spindle.spindle import Spindle

PRELOAD_EXPONENTS = 0.27, 0.32
"""Exponents d ln k / d ln F of radial stiffness k over preload F, angular contact balls of 15 to 25 degrees."""


class RemainingPreload(NamedTuple):
    """Range of the preload over that at the start (-); str() states the assumption."""

    low: float
    """Lower end (-)."""
    high: float
    """Upper end (-)."""

    def __str__(self) -> str:
        """Return a sentence."""
        low, high = (f"{100 * end:.2g}" if end < 0.995 else f"{100 * end:.0f}" for end in self)
        steep, flat = (1 / exponent for exponent in PRELOAD_EXPONENTS)
        law = f"preload ~ stiffness^{flat:.1f} to ^{steep:.1f}"
        return f"remaining preload: {low} to {high} % of the start (ball bearings assumed, {law})"


def remaining_preload(bearings: Iterable[Bearing], *factors: float) -> RemainingPreload | None:
    """Estimate the remaining preload of ball bearings from their stiffness.

    The radial exponents follow from Jones's model without rotation (T. A. Harris and M. N. Kotzalas, Rolling Bearing
    Analysis, 2007). Its axial exponents agree with bearing catalogues, 0.39 to 0.52 at 15 degrees and 0.35 to 0.41 at
    25, or are between them. A finer estimate needs the geometry of the bearings.

    Parameters
    ----------
    bearings : iterable of Bearing
        Bearings.
    *factors : float
        Radial stiffness over that at the start (-), > 0, or both ends of its interval.

    Returns
    -------
    RemainingPreload or None
        Range; None without bearings or if one has rollers.

    Examples
    --------
    >>> left = remaining_preload([Bearing(0.1, 2.5e8), Bearing(0.35, 2.5e8)], 0.8)
    >>> f"{left.low:.2f} to {left.high:.2f} of the preload"
    '0.44 to 0.50 of the preload'
    >>> remaining_preload([Bearing(0.1, 2.5e8, rolling_elements="rollers")], 0.8) is None
    True
    """
    kinds = {bearing.rolling_elements for bearing in bearings}
    if kinds != {"balls"}:
        return None
    left = [factor ** (1 / exponent) for factor in factors for exponent in PRELOAD_EXPONENTS]
    return RemainingPreload(min(left), max(left))


class UnreachableFrequencyError(ValueError):
    """Raised if no bearing stiffness puts the mode at the measured frequency.

    Parameters
    ----------
    message : str
        Text of the error.
    reachable : tuple of float
        Frequencies of the mode without the calibrated bearings and with rigid ones (Hz).

    Examples
    --------
    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> calibrate(spindle, 5000.0)
    Traceback (most recent call last):
        ...
    dsm.calibration.calibration.UnreachableFrequencyError: no bearing stiffness gives mode 1 at 5000 Hz, ...
    """

    def __init__(self, message: str, reachable: tuple[float, float]) -> None:
        super().__init__(message)
        self.reachable = reachable
        """Lowest and highest frequency that a bearing stiffness gives (Hz)."""


@dataclass(frozen=True)
class Calibration:
    """Spindle whose bearing stiffnesses, scaled by one factor, put a mode at its measured frequency.

    "Before" is the spindle as given, "after" the recalibrated one; stiffnesses are those at the tool tip, computed
    when needed. str() gives a report.

    Examples
    --------
    >>> new = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> now = calibrate(new, 0.95 * natural_frequencies(new, 1)[0])
    >>> round(now.energy_share, 2)  # of the bearings in the strain energy of the mode, which makes it sensitive to them
    0.88
    >>> round(now.static_stiffness_after / now.static_stiffness_before, 2)  # left at the tip
    0.98
    """

    frequency: float
    """Measured frequency (Hz)."""
    frequency_std: float | None
    """Standard error of the measured frequency (Hz); None if not given."""
    mode: int
    """Number of the mode; 1 is the lowest."""
    bearing_stiffness: float
    """Mean of the calibrated bearing stiffnesses (N/m); the common one if all were given equal.

    An equivalent number of this model: compare it only with others of the same geometry and beam theory.
    """
    bearing_stiffness_std: float | None
    """Standard error of the bearing stiffness from that of the frequency (N/m); None if not given.

    Of first order: near the limit of rigid bearings the interval is much longer upwards.
    """
    bearing_stiffness_interval: tuple[float, float] | None
    """Ends of its 95 % interval (N/m), from 0 to inf; None without a standard error of the frequency."""
    factor: float
    """Bearing stiffness after over before, the same for all calibrated bearings (-)."""
    sensitivity: float
    """Sensitivity d ln f / d ln k of the mode after calibration (-): half the energy share of these bearings."""
    given: Spindle
    """Spindle as given."""
    parts: tuple[int, ...]
    """Indices of the calibrated parts in `(*bearings, *joints)`."""

    @cached_property
    def spindle(self) -> Spindle:
        """Recalibrated spindle."""
        return scale_parts(self.given, self.parts, self.factor)

    @property
    def energy_share(self) -> float:
        """Share of the calibrated bearings in the strain energy of the mode (-), 0 to 1."""
        return 2 * self.sensitivity

    @property
    def remaining_preload(self) -> RemainingPreload | None:
        """Range of the preload over that as given (-) in the calibrated bearings; None if the stiffness is open."""
        calibrated = [bearing for index, bearing in enumerate(self.given.bearings) if index in self.parts]
        return None if self.is_open else remaining_preload(calibrated, self.factor)

    @property
    def is_open(self) -> bool:
        """True if the frequency leaves the stiffness open: almost no effect, or no upper end."""
        return self.energy_share < MIN_ENERGY_SHARE or self._is_unbounded

    @property
    def _is_unbounded(self) -> bool:
        return self.bearing_stiffness_interval is not None and math.isinf(self.bearing_stiffness_interval[1])

    @property
    def remarks(self) -> tuple[FitRemark, ...]:
        """Remarks on doubtful stiffness."""
        if not self.is_open:
            return ()
        share = f"{100 * self.energy_share:.2g} % of the strain energy of mode {self.mode} in the bearings"
        text = f"bearing stiffness not determined ({share}{', rigid bearings possible' if self._is_unbounded else ''})"
        cure = "Measure another mode, and check whether the spindle model is too soft or too stiff"
        return (FitRemark("bearings-not-felt", "bearings", text, cure),)

    @cached_property
    def residual(self) -> float:
        """Natural frequency of the recalibrated spindle, solved again, less the measured one (Hz)."""
        return float(natural_frequencies(self.spindle, self.mode)[-1]) - self.frequency

    @cached_property
    def static_stiffness_before(self) -> float:
        """Static stiffness at the tip before (N/m)."""
        return static_stiffness(self.given)

    @cached_property
    def static_stiffness_after(self) -> float:
        """Static stiffness at the tip after (N/m)."""
        return static_stiffness(self.spindle)

    @cached_property
    def modal_stiffness_before(self) -> float:
        """Modal stiffness of the mode at the tip before (N/m)."""
        return modal_stiffness(self.given, self.mode)

    @cached_property
    def modal_stiffness_after(self) -> float:
        """Modal stiffness of the mode at the tip after (N/m)."""
        return modal_stiffness(self.spindle, self.mode)

    def __str__(self) -> str:
        """Return the report."""
        start = self.bearing_stiffness / self.factor / 1e6
        static = self.static_stiffness_before / 1e6, self.static_stiffness_after / 1e6
        modal = self.modal_stiffness_before / 1e6, self.modal_stiffness_after / 1e6
        stiffness = format_with_error(self.bearing_stiffness, self.bearing_stiffness_std, 1e6, "N/um", percent=True)
        lines = [
            ("bearing stiffness", f"{stiffness} per bearing"),
            (f"from mode {self.mode}", format_with_error(self.frequency, self.frequency_std, unit="Hz", percent=True)),
            ("start", f"{start:.5g} N/um per bearing, calibration factor {self.factor:.5f}"),
            ("energy share", f"{100 * self.energy_share:.1f} % of the mode's strain energy is in the bearings"),
            ("sensitivity", f"bearings 1 % softer lower the frequency by {self.sensitivity:.3f} %"),
            ("static tip stiffness", f"{static[0]:.3f} -> {static[1]:.3f} N/um (start -> calibrated)"),
            ("modal tip stiffness", f"{modal[0]:.3f} -> {modal[1]:.3f} N/um (start -> calibrated)"),
            ("theory", f"{self.spindle.theory} (stiffness comparable only within this beam theory)"),
        ]
        if self.bearing_stiffness_interval is not None:
            low, high = (end / 1e6 for end in self.bearing_stiffness_interval)
            end = "rigid" if math.isinf(high) else f"{high:.5g} N/um"
            lines.insert(2, ("95 % interval", f"{low:.5g} N/um to {end}"))
        lines += [("warning", str(remark)) for remark in self.remarks]
        return "\n".join(f"{name:<22}{text}" for name, text in lines)
