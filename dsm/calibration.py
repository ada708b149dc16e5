"""What a calibration found."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from dsm.modal_stiffness import modal_stiffness
from dsm.natural_frequencies import natural_frequencies
from dsm.spindle import Spindle
from dsm.static_stiffness import static_stiffness


class UnreachableFrequencyError(ValueError):
    """No bearing stiffness puts the mode at the measured frequency."""

    def __init__(self, message: str, reachable: tuple[float, float]) -> None:
        """Keep the limits beside the message."""
        super().__init__(message)
        self.reachable = reachable
        """Frequencies of the mode without the calibrated bearings and with rigid ones (Hz)."""


@dataclass(frozen=True)
class Calibration:
    """A spindle whose bearing stiffnesses, scaled by one factor, put a mode at its measured frequency.

    "Before" is the spindle as given, "after" the recalibrated one; stiffnesses are those at the tool tip, worked out
    when they are asked for. Printed, it is a report.
    """

    frequency: float
    """Measured frequency (Hz)."""
    frequency_std: float | None
    """Its standard error (Hz); None where it was not given."""
    mode: int
    """Number of the mode it belongs to; 1 is the lowest."""
    bearing_stiffness: float
    """Mean of the calibrated bearing stiffnesses (N/m); the common one where all were given equal.

    An equivalent number of this model: compare it only with others of the same geometry and beam theory.
    """
    bearing_stiffness_std: float | None
    """Its standard error from that of the frequency (N/m); None where that was not given."""
    factor: float
    """Bearing stiffness after over before, the same for all calibrated bearings (-)."""
    sensitivity: float
    """d ln f / d ln k of the mode after calibration, 0 to 1/2 (-): half these bearings' share of its strain energy."""
    given: Spindle
    """The spindle as given."""
    spindle: Spindle
    """The recalibrated spindle."""

    @property
    def energy_share(self) -> float:
        """Share of the calibrated bearings in the strain energy of the mode (-), 0 to 1."""
        return 2 * self.sensitivity

    @cached_property
    def residual(self) -> float:
        """Natural frequency of the recalibrated spindle, solved anew, less the measured one (Hz)."""
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
        """The report."""
        frequency = plus_minus(self.frequency, self.frequency_std, "Hz")
        stiffness = plus_minus(self.bearing_stiffness / 1e6, _scaled_down(self.bearing_stiffness_std), "N/um")
        return "\n".join(
            [
                f"mode {self.mode} measured     {frequency}",
                f"bearing stiffness   {stiffness} each on average ({self.spindle.theory})",
                f"start               {self.bearing_stiffness / self.factor / 1e6:.5g} N/um, factor {self.factor:.5g}",
                f"sensitivity         d ln f / d ln k = {self.sensitivity:.4f}",
                f"energy share        {100 * self.energy_share:.1f} % of the mode's strain energy is in these bearings",
                f"static tip stiffness {self.static_stiffness_before / 1e6:.4g} -> "
                f"{self.static_stiffness_after / 1e6:.4g} N/um",
                f"modal tip stiffness {self.modal_stiffness_before / 1e6:.4g} -> "
                f"{self.modal_stiffness_after / 1e6:.4g} N/um",
            ]
        )


def plus_minus(value: float, std: float | None, unit: str) -> str:
    """A value with its standard error (and that in percent), where there is one."""
    if std is None:
        return f"{value:.6g} {unit}"
    return f"{value:.6g} +/- {std:.2g} {unit} ({100 * std / abs(value):.2g} %)"


def _scaled_down(std: float | None) -> float | None:
    return None if std is None else std / 1e6
