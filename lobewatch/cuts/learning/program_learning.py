"""Learn from the test cuts of a program, and find its next test cut."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lobewatch.cuts.learning import posterior as posteriors
from lobewatch.cuts.learning.cut_likelihood import CutEntries, CutEvidence, estimate_force_by_power
from lobewatch.cuts.learning.posterior import Contradiction, InconsistentCut, Posterior, build_prior
from lobewatch.cuts.learning.suggestion import SPEED_GRID_STEP, CutGrid, Suggestion, compare_zero_order, suggest_cut
from lobewatch.machine import FEED_ANGLES, Machine, ProgramTable
from lobewatch.machine.journal.cut_entry import CutEntry, geometry_key
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.machine.settings.requested_cut import find_by_name
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.tap_series import interpolate_frequency
from lobewatch.verdicts.program_case import build_program
from lobewatch.verdicts.program_samples import build_median_row
from lobewatch.verdicts.uncertainty import uncertainty_of


class LearningResult(NamedTuple):
    """Result of learning for one program."""

    program: ProgramTable
    """Program as in machine.toml."""
    prior: Posterior
    """Prior of spindle and coefficients without any cut."""
    posterior: Posterior
    """Posterior of spindle and coefficients with the cuts."""
    inconsistent_cuts: tuple[InconsistentCut, ...]
    """Rejected cuts. Of some only the power is rejected, and the rest was learned from."""
    own_cuts: tuple[CutEvidence, ...]
    """Cuts of this program's material and geometry, at any speed and depth."""

    @property
    def rejected_cuts(self) -> tuple[CutEvidence, ...]:
        """Cuts with a rejected label."""
        return tuple(odd.cut for odd in self.inconsistent_cuts if odd.contradiction is not Contradiction.POWER)

    @property
    def accepted_cuts(self) -> tuple[CutEvidence, ...]:
        """Cuts with an accepted label."""
        return tuple(cut for cut in self.posterior.cuts if cut not in self.rejected_cuts)


class NextCut(NamedTuple):
    """Next test cut with its basis."""

    learning: LearningResult
    """Result of the cuts made so far."""
    suggestion: Suggestion | None
    """Suggested cut; None if nothing can be gained or all cuts are made."""
    cuts_left: int
    """Number of test cuts left."""
    cut_range: CutRange
    """Speeds and depths that machine and tool allow."""


def find_program(machine: Machine, name: str) -> ProgramTable:
    """Find a program of machine.toml by its name or the beginning of it; ValueError if there is none."""
    return find_by_name({table.name: table for table in machine.program}, name)


def learn_program(table: ProgramTable, tool: Assembly, machine: Machine, cuts: CutEntries) -> LearningResult:
    """Learn from the cuts of a machine; cuts of other tools do not count."""
    start = build_prior(build_median_row(build_program(table, machine), tool), uncertainty_of(tool, table, machine))
    posterior, odd_powers = start, []
    for cut in collect_evidence(cuts, table, tool, machine):
        evidence = posterior.predict(cut)
        if posteriors.is_power_inconsistent(evidence):
            odd_powers.append(InconsistentCut(cut, Contradiction.POWER))
            evidence = evidence._replace(cut=replace(cut, power=None))
        posterior = evidence.update()
    shape = geometry_key(machine.build_cut(table))
    own_cuts = tuple(cut for cut in posterior.cuts if cut.material == 0 and geometry_key(cut.cut) == shape)
    inconsistent = (*posteriors.find_inconsistent_cuts(posterior), *odd_powers)
    return LearningResult(table, start, posterior, inconsistent, own_cuts)


def find_next_cut(table: ProgramTable, tool: Assembly, machine: Machine, cuts: CutEntries, most: int) -> NextCut:
    """Find the next test cut of a program, of `most` cuts."""
    learning = learn_program(table, tool, machine, cuts)
    left = max(most - len(learning.own_cuts), 0)
    reach = CutRange.of(machine, table)
    if not left or reach.is_empty:
        return NextCut(learning, None, left, reach)
    grid = build_cut_grid(table, tool, machine)
    cut = suggest_cut(learning.posterior, grid, learning.own_cuts, left, learning.rejected_cuts, table.depth_mm / 1e3)
    return NextCut(learning, cut, left, reach)


def build_cut_grid(table: ProgramTable, tool: Assembly, machine: Machine) -> CutGrid:
    """Build the grid of speeds and the depths that tool and drive allow."""
    reach = CutRange.of(machine, table)
    speeds = reach.speeds(SPEED_GRID_STEP)
    deepest = reach.depth_limits(speeds) / 1e3
    cut, angles = machine.build_cut(table), tuple(FEED_ANGLES[feed] for feed in table.feed_axes)
    trust = compare_zero_order(tool.x, tool.y, cut, angles, speeds, reach.deepest_mm / 1e3)
    return CutGrid(cut, angles, speeds, deepest, trust)


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
