"""What a calibration found."""

from __future__ import annotations

from dataclasses import dataclass

from dsm.spindle import Spindle


class UnreachableFrequencyError(ValueError):
    """No bearing stiffness puts the mode at the measured frequency."""

    def __init__(self, message: str, reachable: tuple[float, float]) -> None:
        """Keep the limits beside the message."""
        super().__init__(message)
        self.reachable = reachable
        """Frequencies of the mode with no bearings and with rigid ones (Hz)."""


@dataclass(frozen=True)
class Calibration:
    """A spindle whose bearing stiffnesses, all scaled by one factor, put a mode at its measured frequency.

    "Before" is the spindle as given, "after" the recalibrated one; stiffnesses are those at the tool tip.
    """

    frequency: float
    """Measured frequency (Hz)."""
    mode: int
    """Number of the mode it belongs to; 1 is the lowest."""
    bearing_stiffness: float
    """Mean of the bearing stiffnesses after calibration (N/m); the common one where all were given equal.

    An equivalent number of this model: compare it only with others of the same geometry and beam theory.
    """
    bearing_stiffness_std: float | None
    """Its standard error from that of the frequency (N/m); None where that was not given."""
    factor: float
    """Bearing stiffness after over before, the same for all bearings (-)."""
    sensitivity: float
    """d ln f / d ln k of the mode after calibration, 0 to 1/2 (-): half the bearings' share of its strain energy."""
    residual: float
    """Natural frequency of the recalibrated spindle, solved anew, less the measured one (Hz)."""
    static_stiffness_before: float
    """Static stiffness at the tip before (N/m)."""
    static_stiffness_after: float
    """Static stiffness at the tip after (N/m)."""
    modal_stiffness_before: float
    """Modal stiffness of the mode at the tip before (N/m)."""
    modal_stiffness_after: float
    """Modal stiffness of the mode at the tip after (N/m)."""
    spindle: Spindle
    """The recalibrated spindle."""
