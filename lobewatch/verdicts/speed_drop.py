"""Frequency drop at speed: how far the natural frequencies of a turning spindle are below those of the tap test.

Centrifugal force unloads the inner races of the bearings, heat may load them again: `[speed] drop_percent` is a range.
The modal masses stay, so that K drops with the square of the frequency, and zeta stays. All modes drop together, each
in proportion to what softer bearings do to it in the model of the spindle, and alike without a model.
"""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from dsm import Calibration, natural_frequencies
from lobes import MillingRows
from lobewatch.arrays import Floats
from lobewatch.machine import Machine, SpeedTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.uncertainty import scale_fields

SOFTENED_BEARINGS = 0.71
"""Stiffness of bearings at 12 000 rpm over that at rest, by a Jones model of a 70 mm bearing with locked preload."""
N_MODEL_MODES = 6
"""Number of modes of the model that measured modes are assigned to."""
MAX_MODE_DISTANCE = 0.15
"""Largest relative distance of a measured mode from its mode of the model; farther ones drop alike; chosen."""
MIN_MODEL_DROP = 0.005
"""Drop of the calibrated mode in the model, below which bearings do not explain its drop: all modes drop alike."""
MAX_MODE_SHARE = 2.5
"""Largest drop of a mode over that of the calibrated mode: 5 to 13 % and 2 to 8 % in the model of the study."""
GOLDEN_RATIO = (5**0.5 - 1) / 2
"""Step that spreads the drops of the samples evenly over the range, whatever their number."""
DROP_STEP = 0.005
"""Largest step of the relative drop at which critical samples are checked; chosen: half the uncertainty of speed."""


@dataclass(frozen=True, eq=False)
class SpeedDrop:
    """Range of the relative frequency drop at the speed of a cut; negative is a rise."""

    low: float = 0.0
    """Smallest drop."""
    high: float = 0.0
    """Largest drop."""
    shares: Floats = field(default_factory=lambda: np.ones(1))
    """Drop of each mode over that of the calibrated mode, modes in x, then y, shape (n,); (1,) if all drop alike."""

    @property
    def is_zero(self) -> bool:
        """True if nothing drops."""
        return self.low == self.high == 0

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest drop of any mode; 0, not rotating, is included."""
        drops = np.multiply.outer((self.low, self.high), self.shares)
        return float(np.min(drops, initial=0.0)), float(np.max(drops, initial=0.0))

    @property
    def largest(self) -> float:
        """Largest drop of any mode, at least 0."""
        return self.ends[1]

    def age(self, drop: float) -> tuple[float, float]:
        """Return these ends with a frequency drop by age on top of the largest."""
        low, high = self.ends
        return low, 1 - (1 - high) * (1 - drop)

    @property
    def steps(self) -> Floats:
        """Drops from the smallest to the largest, shape (k,)."""
        number = int(np.ceil((self.high - self.low) / DROP_STEP - 1e-9)) + 1
        return np.linspace(self.low, self.high, number)

    def spread(self, count: int) -> Floats:
        """Spread the drops of samples evenly over the range, shape (count,); the median has the largest."""
        shares = np.arange(count) * GOLDEN_RATIO % 1
        return np.where(np.arange(count) == 0, self.high, self.low + (self.high - self.low) * shares)

    def apply(self, rows: MillingRows, drops: Floats) -> MillingRows:
        """Lower the natural frequencies of each row by its drop (r,), at constant modal mass."""
        lower = 1 - drops[:, np.newaxis] * self.shares
        return scale_fields(rows, frequency=lower, stiffness=lower**2)


DEFAULT_DROP = SpeedDrop(*SpeedTable().drop_range(math.inf))
"""Drop of a machine that states none."""
NO_DROP = SpeedDrop()
"""No drop, as where test cuts show the spindle at speed."""


def find_speed_drop(assembly: Assembly, machine: Machine, speed_rpm: float) -> SpeedDrop:
    """Find the frequency drop of a tool at a speed (rpm), by [speed] and the model of the spindle.

    Parameters
    ----------
    assembly
        Tool as tapped or predicted.
    machine
        Machine with its [speed] table.
    speed_rpm
        Spindle speed (rpm).

    Returns
    -------
    SpeedDrop
        Range and shares of the modes.

    References
    ----------
    .. [1] Jones, A general theory for elastically constrained ball and radial roller bearings, 1960.
    """
    low, high = machine.speed.drop_range(speed_rpm)
    return SpeedDrop(low, high, find_drop_shares(assembly))


def find_drop_shares(assembly: Assembly) -> Floats:
    """Find the drop of each mode over that of the calibrated mode, shape (n,); 1 without a model."""
    frequencies = np.array([mode.frequency for mode in (*(assembly.x or ()), *(assembly.y or ()))])
    if assembly.calibration is None:
        return np.ones(1)
    known, drops = _model_drops(assembly.calibration)
    reference = drops[assembly.calibration.mode - 1]
    if reference < MIN_MODEL_DROP:
        return np.ones(1)
    distance = np.abs(np.log(frequencies[:, np.newaxis] / known))
    shares = np.minimum(drops[np.argmin(distance, axis=1)] / reference, MAX_MODE_SHARE)
    return np.where(np.min(distance, axis=1) < MAX_MODE_DISTANCE, shares, 1.0)


@lru_cache(maxsize=8)
def _model_drops(calibration: Calibration) -> tuple[Floats, Floats]:
    """Return natural frequencies of the model (Hz), and their relative drops with softer bearings."""
    count = max(N_MODEL_MODES, calibration.mode)
    softer = replace(calibration, factor=SOFTENED_BEARINGS * calibration.factor)
    before, after = (natural_frequencies(spindle, count) for spindle in (calibration.spindle, softer.spindle))
    return before, 1 - after / before
