"""Test cuts of a tool as evidence, and depths of stable pockets by them only, for taps without a force sensor."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Remark
from lobewatch.cuts.learning.cut_likelihood import CutEntries, CutEvidence, estimate_force_by_power
from lobewatch.machine import FEED_ANGLES, Machine, ProgramTable
from lobewatch.machine.journal.entries import CutEntry, geometry_key
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM, SPEED_STEP_RPM, CutRange, round_down_depth_mm
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.tap_series import interpolate_frequency
from lobewatch.verdicts.speed_pockets import SpeedPocket, find_speed_pockets
from lobewatch.verdicts.verdict import NOT_CHECKED_CODE, Stability, Verdict

MAX_POCKET_CUTS = 5
"""Number of test cuts in a pocket after which its depth is final."""
FIRST_DEPTH_SHARE = 0.25
"""Depth of the first cut over that of the program."""
MIN_DEPTH_RATIO = 1.2
"""Ratio of chattering to stable depth below which no further cut is made."""
PROGRAM_SPEED_TOLERANCE = 0.01
"""Relative difference of two equal speeds."""


@dataclass(frozen=True)
class PocketDepth:
    """Stable pocket with its test cuts."""

    pocket: SpeedPocket
    """Pocket by f_n and damping."""
    speed_rpm: float
    """Speed to cut at (rpm), the middle of the window."""
    cuts: tuple[CutEvidence, ...]
    """Cuts of the same cutter, material and immersion in the window."""
    max_depth: float
    """Largest depth that machine and tool allow there (m)."""

    @property
    def chatter_depth(self) -> float:
        """Smallest depth with chatter (m); inf without chatter."""
        return min((cut.depth for cut in self.cuts if cut.has_chatter), default=math.inf)

    @property
    def stable_depth(self) -> float:
        """Largest stable depth below all chatter (m); 0 without one."""
        stable = (cut.depth for cut in self.cuts if not cut.has_chatter)
        return max((depth for depth in stable if depth < self.chatter_depth), default=0.0)

    def next_depth(self, first: float) -> float | None:
        """Choose the depth of the next cut (m): twice the stable one, or between stable and chatter, or None.

        first: depth to begin with (m).
        """
        if len(self.cuts) >= MAX_POCKET_CUTS:
            return None
        if not self.stable_depth:
            wanted = first if math.isinf(self.chatter_depth) else self.chatter_depth / 2
        elif math.isinf(self.chatter_depth):
            wanted = 2 * self.stable_depth
        elif self.chatter_depth > MIN_DEPTH_RATIO * self.stable_depth:
            wanted = math.sqrt(self.stable_depth * self.chatter_depth)
        else:
            wanted = self.stable_depth
        wanted = round_down_depth_mm(1e3 * min(wanted, self.max_depth)) / 1e3
        return wanted if wanted > self.stable_depth else None


def find_pocket_depths(table: ProgramTable, tool: Assembly, machine: Machine, cuts: CutEntries) -> list[PocketDepth]:
    """Find the best pockets of a program with their test cuts, the nearest to its own speed first."""
    own, reach = _find_own_cuts(table, tool, machine, cuts), CutRange.of(machine, table)
    depths = []
    for pocket in find_speed_pockets(table, tool, machine):
        speed = round(sum(pocket.window_rpm) / 2 / SPEED_STEP_RPM) * SPEED_STEP_RPM
        inside = tuple(cut for cut in own if pocket.contains(cut.speed_rpm))
        depths.append(PocketDepth(pocket, speed, inside, float(reach.depth_limits(np.array([speed]))[0]) / 1e3))
    return sorted(depths, key=lambda found: abs(math.log(found.speed_rpm / table.speed_rpm)))


def choose_first_depth(table: ProgramTable) -> float:
    """Choose the depth of the first cut (m): a part of that of the program."""
    return max(round_down_depth_mm(FIRST_DEPTH_SHARE * table.depth_mm), DEPTH_STEP_MM) / 1e3


def apply_test_cuts(verdict: Verdict, tool: Assembly, machine: Machine, cuts: CutEntries) -> Verdict:
    """Set the stability of a program without a limit from test cuts at its speed; doubtful at best."""
    program, depth = verdict.program, verdict.program.depth_mm / 1e3
    own = _find_own_cuts(program, tool, machine, cuts)
    at_speed = [cut for cut in own if abs(cut.speed_rpm / program.speed_rpm - 1) <= PROGRAM_SPEED_TOLERANCE]
    chattering = [cut for cut in at_speed if cut.has_chatter and cut.depth <= depth]
    stable = [cut for cut in at_speed if not cut.has_chatter and cut.depth >= depth]
    if not chattering and not stable:
        return verdict
    found = (chattering or stable)[-1]
    word, what = (Stability.NOT_STABLE, "chatter") if chattering else (Stability.DOUBTFUL, "stable")
    place = f"{what} at {LENGTH.text(1e3 * found.depth, '.4g')}"
    text = f"verdict based only on cut {found.id} ({place}), because stiffness K is unknown"
    remark = Remark("heard-alone", program.name, text, "Tap the tool with an instrumented hammer")
    others = [other for other in verdict.remarks if other.code != NOT_CHECKED_CODE]
    return replace(verdict, stability=word, remarks=(remark, *others))


def _find_own_cuts(table: ProgramTable, tool: Assembly, machine: Machine, cuts: CutEntries) -> list[CutEvidence]:
    """Find the cuts of this program, at speeds corrected for the change of the natural frequency."""
    shape = geometry_key(machine.build_cut(table))
    evidence = collect_evidence(cuts, table, tool, machine)
    own = [cut for cut in evidence if cut.material == 0 and geometry_key(cut.cut) == shape]
    return [replace(cut, speed_rpm=cut.speed_rpm / cut.frequency_ratio) for cut in own]


def collect_evidence(cuts: CutEntries, table: ProgramTable, tool: Assembly, machine: Machine) -> Iterator[CutEvidence]:
    """Yield the usable cuts of the same tool, oldest first."""
    known = machine.coefficients(table)
    materials = [(known.material, known.tangential, known.radial)]
    for entry in cuts:
        if entry.tool != table.tool or not entry.is_usable:
            continue
        material = entry.coefficients, entry.cut.tangential, entry.cut.radial
        if material not in materials:
            materials.append(material)
        yield _build_evidence(entry, materials.index(material), tool)


def _build_evidence(cut: CutEntry, material: int, tool: Assembly) -> CutEvidence:
    angles = FEED_ANGLES.values() if cut.feed == "both" else (FEED_ANGLES[cut.feed],)
    frequency = float("nan") if cut.chatter_frequency_hz is None else cut.chatter_frequency_hz
    power = None if cut.power is None else estimate_force_by_power(cut.power, cut.cut, cut.has_chatter)
    made = cut.cut, cut.speed_rpm, cut.depth, cut.word, frequency, tuple(angles), material
    return CutEvidence(*made, cut.by != "ear", _frequency_ratio(cut, tool), cut.id, power)


def _frequency_ratio(cut: CutEntry, tool: Assembly) -> float:
    """Return the natural frequency at the time of a cut over that of now, averaged over directions; 1 if unknown."""
    known = [series for series in tool.series.values() if series]
    pairs = [(interpolate_frequency(series, cut.at), series[-1].frequency) for series in known]
    ratios = [before / now for before, now in pairs if before is not None]
    return float(np.mean(ratios)) if ratios else 1.0
