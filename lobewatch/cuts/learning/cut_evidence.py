"""One test cut as evidence: label, cutting force by power, and repeated cuts.

All that is chosen here is plausible, not measured, but for cuts that chatter.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from lobes import Cut
from lobewatch.machine.journal.cut_entry import CutEntry, CutVerdict
from lobewatch.machine.settings.drive_power import CutPower

CutEntries = Sequence[CutEntry]
"""Test cuts of a machine as in its journal, oldest first."""

DRIVE_POWER_SPREAD = 0.15
"""Relative standard deviation of displayed drive power over that of the cuts, common to all cuts.

Causes: efficiency of motor, belt and gears under load, losses that the display omits, and edge forces that are not
proportional to Kt."""
EDGE_FORCE_SPREAD, UNKNOWN_EDGE_FORCE_SPREAD = 0.3, 0.5
"""Relative standard deviation of Kte over Kt if Kte is known, and if it is not.

Edges may be sharper or duller than those measured. Published values differ by a factor of three."""
POWER_READING_SPREAD = 0.05
"""Relative standard deviation of one power reading, by an unsteady display, feed or radial depth."""
CHATTER_POWER_FACTOR, CHATTER_POWER_SPREAD = 0.89, 0.08
"""Power of a chattering cut over that of a stable one, and its scatter between cuts, from time-domain simulations.

Edges that leave the cut do not rub, and thick chips between thin ones take less power. See docs/cuts.md."""


@dataclass(frozen=True)
class PowerEvidence:
    """Kt by power, with errors as standard deviations of its logarithm."""

    force: float
    """Kt over the assumed Kt of the cut."""
    common_error: float
    """Error common to all readings of a material."""
    own_error: float
    """Error of this reading only."""


def estimate_force_by_power(power: CutPower, cut: Cut, chatters: bool) -> PowerEvidence:
    """Estimate Kt from the drive power of a cut in a material."""
    of_edges = power.edge_share / (1 + power.edge_share)
    edge_spread = EDGE_FORCE_SPREAD if power.edge_known else UNKNOWN_EDGE_FORCE_SPREAD
    common = math.hypot(DRIVE_POWER_SPREAD, edge_spread * of_edges)
    median, scatter = (CHATTER_POWER_FACTOR, CHATTER_POWER_SPREAD) if chatters else (1.0, 0.0)
    return PowerEvidence(power.tangential / cut.tangential / median, common, math.hypot(POWER_READING_SPREAD, scatter))


AGED_FREQUENCY_CHANGE = 0.02
"""Relative change of the natural frequency after which a cut has 61 % of its weight; chosen."""
REPEAT_SPEED_TOLERANCE, REPEAT_DEPTH_TOLERANCE = 0.002, 0.01
"""Relative differences of speed and depth within which a cut repeats another."""


@dataclass(frozen=True)
class CutEvidence:
    """One test cut in SI units."""

    cut: Cut
    """Teeth, pitch, immersion, direction, helix, and assumed cutting coefficients."""
    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut (m)."""
    verdict: CutVerdict
    """Verdict by chatter detection."""
    frequency: float = math.nan
    """Chatter frequency (Hz); NaN if not recorded."""
    feed_angles: tuple[float, ...] = (0.0,)
    """Possible feed directions as angles from x (rad); the worst counts."""
    material: int = 0
    """Number of the material. Cuts with the same number share cutting coefficients; 0 is that of the evaluated cut."""
    speed_found: bool = True
    """True if the speed was found in the recording; False if it is the commanded one."""
    frequency_ratio: float = 1.0
    """Natural frequency not rotating at the time of the cut over that of now."""
    id: str = ""
    """Number of the cut in the journal."""
    power: PowerEvidence | None = None
    """Kt by power; None without a power reading."""

    @property
    def weight(self) -> float:
        """Weight of the cut, which decreases as the natural frequency changes."""
        return math.exp(-(((self.frequency_ratio - 1) / AGED_FREQUENCY_CHANGE) ** 2) / 2)

    def is_repeat_of(self, other: CutEvidence) -> bool:
        """Return whether another cut repeats this one: same program, material, speed and depth."""
        near = abs(math.log(other.speed_rpm / self.speed_rpm)) < REPEAT_SPEED_TOLERANCE
        same = (self.cut, self.material, self.feed_angles) == (other.cut, other.material, other.feed_angles)
        return near and same and abs(math.log(other.depth / self.depth)) < REPEAT_DEPTH_TOLERANCE

    @property
    def tooth_frequency(self) -> float:
        """Repetition frequency of the cut (Hz), the tooth passing frequency for equal pitches."""
        return self.cut.repeats_per_turn * self.speed_rpm / 60

    @property
    def has_chatter(self) -> bool:
        """True if the cut was not stable."""
        return self.verdict != "stable"

    @property
    def has_frequency(self) -> bool:
        """True if the cut has information on natural frequencies."""
        return self.verdict == "flip" or (self.has_chatter and math.isfinite(self.frequency))


TAKEN_SPEED_TOLERANCE, TAKEN_DEPTH_TOLERANCE = 0.01, 0.04
"""Relative distances in speed, and to smaller depth, within which a chattering cut excludes a candidate; chosen.

Smaller differences in depth than `LIMIT_SPREAD` are left to the posterior samples."""
REJECTED_DEPTH_TOLERANCE = 0.10
"""Relative distance in depth within which a cut with a rejected label excludes no candidate."""


def is_setting_taken(
    speed_rpm: float, depth: float, cuts: Sequence[CutEvidence], rejected: Collection[CutEvidence] = ()
) -> bool:
    """Return whether chatter was recorded at a setting (rpm, m) or hardly deeper, and no stable cut there since.

    doubted: cuts that are not believed, which take more.
    """
    return any(
        cut.has_chatter
        and abs(math.log(speed_rpm / cut.speed_rpm)) < TAKEN_SPEED_TOLERANCE
        and depth > (1 - (REJECTED_DEPTH_TOLERANCE if cut in rejected else TAKEN_DEPTH_TOLERANCE)) * cut.depth
        and not any(cut.is_repeat_of(later) and not later.has_chatter for later in cuts[place + 1 :])
        for place, cut in enumerate(cuts)
    )


def find_cut_to_repeat(cuts: Sequence[CutEvidence], rejected: Collection[CutEvidence]) -> CutEvidence | None:
    """Find the first rejected cut that was made only once, or None."""
    made_once = (cut for cut in cuts if sum(cut.is_repeat_of(other) for other in cuts) == 1)
    return next((cut for cut in made_once if cut in rejected), None)
