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
"""Standard deviation, relative, of the power that a drive shows over that of its cuts, the same in all: efficiency
of motor, belt and gears under load, what the display leaves out, edges that do not rub in proportion to Kt."""
EDGE_FORCE_SPREAD, UNKNOWN_EDGE_FORCE_SPREAD = 0.3, 0.5
"""Standard deviations, relative, of Kte over Kt where it is known (edges are sharper or duller than those that it
was measured with), and where it is not: what is published differs by three times."""
POWER_READING_SPREAD = 0.05
"""Standard deviation, relative, of one reading: a display that jumps, a feed or a radial depth a little off."""
CHATTER_POWER_FACTOR, CHATTER_POWER_SPREAD = 0.89, 0.08
"""Power of a cut that chatters over that of a stable one, and how far that scatters from cut to cut, by simulations
in time: edges that have left the cut do not rub, and thick chips, which it has next to thin ones, cost less.
See docs/cuts.md."""


@dataclass(frozen=True)
class PowerEvidence:
    """Kt by power; errors as standard deviations of its logarithm."""

    force: float
    """Kt over the one that the cut was taken for."""
    common_error: float
    """Error that all readings of a material share."""
    own_error: float
    """Error of this one alone."""


def estimate_force_by_power(power: CutPower, cut: Cut, chatters: bool) -> PowerEvidence:
    """Estimate Kt from the drive power of a cut in a material."""
    of_edges = power.edge_share / (1 + power.edge_share)
    edge_spread = EDGE_FORCE_SPREAD if power.edge_known else UNKNOWN_EDGE_FORCE_SPREAD
    common = math.hypot(DRIVE_POWER_SPREAD, edge_spread * of_edges)
    median, scatter = (CHATTER_POWER_FACTOR, CHATTER_POWER_SPREAD) if chatters else (1.0, 0.0)
    return PowerEvidence(power.tangential / cut.tangential / median, common, math.hypot(POWER_READING_SPREAD, scatter))


AGED_FREQUENCY_CHANGE = 0.02
"""Change of the natural frequency, relative, after which a cut says 61 % of what it said; chosen."""
REPEAT_SPEED_TOLERANCE, REPEAT_DEPTH_TOLERANCE = 0.002, 0.01
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
    verdict: CutVerdict
    """Verdict on its sound."""
    frequency: float = math.nan
    """Chatter frequency (Hz); NaN where none was recorded or told."""
    feed_angles: tuple[float, ...] = (0.0,)
    """Directions it may have been fed in, as angles from x (rad): the worst counts."""
    material: int = 0
    """Cuts with the same number share their cutting coefficients; 0 are those of the cut asked about."""
    speed_found: bool = True
    """Whether the speed was found in the sound; else it is the commanded one."""
    frequency_ratio: float = 1.0
    """Natural frequency at rest when it was made, over that of now."""
    id: str = ""
    """Number of the cut in the journal."""
    power: PowerEvidence | None = None
    """Kt by its power; None where nobody has read it."""

    @property
    def weight(self) -> float:
        """Weight of what it says: less, the more the natural frequency has moved since."""
        return math.exp(-(((self.frequency_ratio - 1) / AGED_FREQUENCY_CHANGE) ** 2) / 2)

    def is_repeat_of(self, other: CutEvidence) -> bool:
        """Return whether another cut repeats this one: same program, material, speed and depth."""
        near = abs(math.log(other.speed_rpm / self.speed_rpm)) < REPEAT_SPEED_TOLERANCE
        same = (self.cut, self.material, self.feed_angles) == (other.cut, other.material, other.feed_angles)
        return near and same and abs(math.log(other.depth / self.depth)) < REPEAT_DEPTH_TOLERANCE

    @property
    def tooth_frequency(self) -> float:
        """Times a second that the cut repeats (Hz): teeth a second where they are evenly spaced."""
        return self.cut.repeats_per_turn * self.speed_rpm / 60

    @property
    def has_chatter(self) -> bool:
        """Whether it was not stable."""
        return self.verdict != "stable"

    @property
    def has_frequency(self) -> bool:
        """Whether it says something of natural frequencies."""
        return self.verdict == "flip" or (self.has_chatter and math.isfinite(self.frequency))


TAKEN_SPEED_TOLERANCE, TAKEN_DEPTH_TOLERANCE = 0.01, 0.04
"""Relative distances in speed, and towards less depth, up to which a chattering cut takes the place; chosen: what is
less deep than an edge (`LIMIT_SPREAD`) the spindles that are learned tell by themselves ..."""
REJECTED_DEPTH_TOLERANCE = 0.10
"""... but not where they do not believe it."""


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
    for cut in cuts:
        if cut in rejected and sum(cut.is_repeat_of(other) for other in cuts) == 1:
            return cut
    return None
