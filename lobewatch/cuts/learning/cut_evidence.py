"""One cut as the learning takes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lobes import Cut
from lobewatch.cuts.learning.force_by_power import ForceByPower
from lobewatch.machine.journal.heard_cut import CutWord

AGED = 0.02
"""Change of the natural frequency, relative, after which a cut says 61 % of what it said; chosen."""
SAME_SPEED, SAME_DEPTH = 0.002, 0.01
"""Relative distances up to which a cut is another one again."""


@dataclass(frozen=True)
class CutEvidence:
    """One test cut in SI units."""

    cut: Cut
    """Teeth and their pitch, immersion, direction, helix, and the coefficients that its material was taken for."""
    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth (m)."""
    word: CutWord
    """Word for what it sounded like."""
    frequency: float = math.nan
    """Chatter frequency (Hz); NaN where none was heard or told."""
    feed_angles: tuple[float, ...] = (0.0,)
    """Directions it may have been fed in, as angles from x (rad): the worst counts."""
    material: int = 0
    """Cuts with the same number share their cutting coefficients; 0 are those of the cut asked about."""
    speed_found: bool = True
    """Whether the speed was found in the sound; else it is the commanded one."""
    moved: float = 1.0
    """Natural frequency at rest when it was made, over that of now."""
    id: str = ""
    """Number of the cut in the journal."""
    power: ForceByPower | None = None
    """Kt by its power; None where nobody has read it."""

    @property
    def weight(self) -> float:
        """Weight of what it says: less, the more the natural frequency has moved since."""
        return math.exp(-(((self.moved - 1) / AGED) ** 2) / 2)

    def is_again(self, other: CutEvidence) -> bool:
        """Whether another cut is this one made again: of one program, in one material, at one speed and depth."""
        near = abs(math.log(other.speed_rpm / self.speed_rpm)) < SAME_SPEED
        same = (self.cut, self.material, self.feed_angles) == (other.cut, other.material, other.feed_angles)
        return near and same and abs(math.log(other.depth / self.depth)) < SAME_DEPTH

    @property
    def tooth_frequency(self) -> float:
        """Times a second that the cut repeats (Hz): teeth a second where they are evenly spaced."""
        return self.cut.repeats * self.speed_rpm / 60

    @property
    def chatters(self) -> bool:
        """Whether it was not stable."""
        return self.word != "stable"

    @property
    def has_frequency(self) -> bool:
        """Whether it says something of natural frequencies."""
        return self.word == "flip" or (self.chatters and math.isfinite(self.frequency))
