"""Learn from the test cuts of a program, evaluate it with the spindle at speed, and find its next test cut."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from acquisition import DataError
from lobes import StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.cuts.learning import posterior as posteriors
from lobewatch.cuts.learning.cut_likelihood import CutEntries, CutEvidence
from lobewatch.cuts.learning.pocket_depth import apply_test_cuts, collect_evidence
from lobewatch.cuts.learning.posterior import POWER_CONTRADICTIONS, Contradiction, InconsistentCut, Posterior
from lobewatch.cuts.learning.power_readings import is_off_by_two
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.cuts.learning.process_damping import find_process_damping
from lobewatch.cuts.learning.suggestion import (
    SPEED_GRID_STEP,
    CutGrid,
    Suggestion,
    compare_zero_order,
    find_cut_to_ask,
    suggest_cut,
)
from lobewatch.machine import FEED_ANGLES, CutTable, Machine, ProgramTable
from lobewatch.machine.journal.entries import geometry_key
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.machine.settings.requested_cut import find_by_name
from lobewatch.tool.assembly import Assembly, compute_tip_lobes
from lobewatch.verdicts.monte_carlo import LimitBand, compute_limit_band
from lobewatch.verdicts.program_case import NO_TEST_CUTS, SpindleAtSpeed, build_program
from lobewatch.verdicts.program_samples import N_PROGRAM_SAMPLES, build_median_row
from lobewatch.verdicts.speed_drop import find_speed_drop
from lobewatch.verdicts.uncertainty import FactorRange, LearnedSamples, Uncertainty, uncertainty_of
from lobewatch.verdicts.uncertainty_causes import TEST_CUTS
from lobewatch.verdicts.verdict import Verdict, evaluate_program


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
        return tuple(odd.cut for odd in self.inconsistent_cuts if odd.contradiction not in POWER_CONTRADICTIONS)

    @property
    def accepted_cuts(self) -> tuple[CutEvidence, ...]:
        """Cuts with an accepted label."""
        return tuple(cut for cut in self.posterior.cuts if cut.has_verdict and cut not in self.rejected_cuts)


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
    asked: CutEvidence | None = None
    """Stable cut that is questioned by name, or None."""


def find_program(machine: Machine, name: str) -> ProgramTable:
    """Find a program of machine.toml by its name or the beginning of it; ValueError if there is none."""
    return find_by_name({table.name: table for table in machine.program}, name)


def learn_program(table: ProgramTable, tool: Assembly, machine: Machine, cuts: CutEntries) -> LearningResult:
    """Learn from the cuts of a machine; cuts of other tools do not count."""
    resting, doubt = build_median_row(build_program(table, machine), tool), uncertainty_of(tool, table, machine)
    drop, damping = find_speed_drop(tool, machine, machine.speed.high_rpm), find_process_damping(table, machine)
    start = posteriors.build_prior(resting, doubt, drop=drop, damping=damping)
    posterior, odd_powers, material = start, list[InconsistentCut](), list[InconsistentCut]()
    for cut in collect_evidence(cuts, table, tool, machine):
        evidence = posterior.predict(cut)
        force, is_odd = 1.0 if cut.power is None else cut.power.force, posteriors.is_power_inconsistent(evidence)
        if is_odd:
            odd_powers.append(InconsistentCut(cut, Contradiction.POWER))
        elif is_off_by_two(force):
            material = [InconsistentCut(cut, Contradiction.MATERIAL)]
        is_left_out = is_odd or (force < 1 and is_off_by_two(force))
        posterior = (evidence.without_power() if is_left_out else evidence).update()
    shape, verdicts = geometry_key(machine.build_cut(table)), [cut for cut in posterior.cuts if cut.has_verdict]
    own_cuts = tuple(cut for cut in verdicts if cut.material == 0 and geometry_key(cut.cut) == shape)
    inconsistent = (*posteriors.find_inconsistent_cuts(posterior), *odd_powers, *material)
    return LearningResult(table, start, posterior, inconsistent, own_cuts)


def find_next_cut(table: ProgramTable, tool: Assembly, machine: Machine, cuts: CutEntries, most: int) -> NextCut:
    """Find the next test cut of a program, of `most` cuts."""
    learning = learn_program(table, tool, machine, cuts)
    left = max(most - len(learning.own_cuts), 0)
    reach = CutRange.of(machine, table)
    asked = find_cut_to_ask(learning.posterior, learning.own_cuts)
    if not left or reach.is_empty:
        return NextCut(learning, None, left, reach, asked)
    grid = build_cut_grid(table, tool, machine)
    cut = suggest_cut(learning.posterior, grid, learning.own_cuts, left, learning.rejected_cuts, table.depth_mm / 1e3)
    return NextCut(learning, cut, left, reach, asked)


def build_cut_grid(table: ProgramTable, tool: Assembly, machine: Machine) -> CutGrid:
    """Build the grid of speeds and the depths that tool and drive allow."""
    reach = CutRange.of(machine, table)
    speeds = reach.speeds(SPEED_GRID_STEP)
    deepest = reach.depth_limits(speeds) / 1e3
    cut, angles = machine.build_cut(table), tuple(FEED_ANGLES[feed] for feed in table.feed_axes)
    trust = compare_zero_order(tool.x, tool.y, cut, angles, speeds, reach.deepest_mm / 1e3)
    return CutGrid(cut, angles, speeds, deepest, trust)


MAX_UNTAUGHT_SHARE = 0.05
"""Largest share of samples with the lowest process damping at which test cuts have taught more; chosen."""
INTERVAL_QUANTILES = (0.025, 0.975)
"""Quantiles of a 95 % interval."""


def evaluate_at_speed(table: ProgramTable, tool: Assembly | DataError, machine: Machine, cuts: CutEntries) -> Verdict:
    """Evaluate a program, at speed as far as cuts have been learned from."""
    posterior = NO_TEST_CUTS if isinstance(tool, DataError) else learn_spindle(table, tool, machine, cuts)
    verdict = evaluate_program(table, tool, machine, posterior)
    if isinstance(tool, DataError) or tool.directions or not tool.without_stiffness:
        return verdict
    return apply_test_cuts(verdict, tool, machine, cuts)


def learn_spindle(table: CutTable, tool: Assembly, machine: Machine, cuts: CutEntries) -> SpindleAtSpeed:
    """Learn the spindle at speed from the cuts of a program; nothing for the reference cut."""
    if not isinstance(table, ProgramTable) or not tool.directions:
        return NO_TEST_CUTS
    if not any(cut.tool == table.tool and cut.is_usable for cut in cuts):
        return NO_TEST_CUTS
    learning = learn_program(table, tool, machine, cuts)
    remarks = tuple(posteriors.inconsistent_cut_remarks(learning.posterior, learning.inconsistent_cuts, table.name))
    return replace(_build_spindle(learning, tool, machine) if learning.accepted_cuts else NO_TEST_CUTS, remarks=remarks)


def _build_spindle(learning: LearningResult, tool: Assembly, machine: Machine) -> SpindleAtSpeed:
    """Build the spindle at speed from a learning result."""
    at_rest = build_median_row(build_program(learning.program, machine), tool)
    samples = learning.posterior.draw(N_PROGRAM_SAMPLES)
    rows = samples.build_rows(1.0, float(at_rest.tangential[0]), float(at_rest.radial[0]))
    parts = [getattr(rows, name) / getattr(at_rest, name) for name in ("frequency", "damping_ratio", "stiffness")]
    median, phases = [np.mean(part, axis=0) for part in parts], rows.phase - at_rest.phase
    force, direction = (samples.ratios()[name] for name in ("tangential", "ratio"))
    push, ratio = float(np.mean(force)), float(np.mean(direction))
    frequency, damping, stiffness = (part / mean for part, mean in zip(parts, median, strict=True))
    direction_over_mean = direction / np.mean(direction) if np.all(direction > 0) else np.ones(direction.shape)
    taught = _taught_process_damping(samples)
    force_over_mean = force / np.mean(force)
    left = LearnedSamples(
        frequency, damping, stiffness, phases, force_over_mean, direction_over_mean, taught / samples.damping.diameter
    )
    widths = {TEST_CUTS.name: _half_widths(parts, phases)}
    mixing, speed = np.tile(np.eye(4), (at_rest.direction.size, 1, 1)), machine.doubt.speed_percent / 100
    ranges, axes = (_factor_range(force), _factor_range(direction)), tool.principal_directions
    uncertainty = Uncertainty(widths, mixing, speed, *ranges, axes=axes, learned=left)
    kt, kr = float(at_rest.tangential[0]) * push / 1e6, float(at_rest.radial[0]) * push * ratio / 1e6
    intervals = _factor_ranges(learning.prior), _factor_ranges(learning.posterior)
    factors, mean_damping = np.stack(median, axis=1), float(np.mean(taught))
    return SpindleAtSpeed(len(learning.accepted_cuts), (), uncertainty, factors, kt, kr, mean_damping, *intervals)


def _taught_process_damping(samples: SpindleSamples) -> Floats:
    """Return C of each sample (N/m), or the lowest before the cuts while they may be explained by it, shape (r,)."""
    damping, lowest = samples.process_damping(0), samples.damping.low
    is_taught = np.mean(damping <= lowest) <= MAX_UNTAUGHT_SHARE
    return damping if is_taught else np.full(damping.shape, lowest)


def _half_widths(parts: Sequence[Floats], turned: Floats) -> Floats:
    """Return 95 % half-widths of frequency, damping ratio, stiffness (relative) and phase (rad), shape (n, 4)."""
    widths = [np.diff(np.quantile(part, INTERVAL_QUANTILES, axis=0), axis=0)[0] / 2 for part in parts]
    relative = [width / np.mean(part, axis=0) for width, part in zip(widths, parts, strict=True)]
    return np.stack([*relative, np.std(turned, axis=0) * 2], axis=1)


def _factor_ranges(posterior: Posterior) -> dict[str, FactorRange]:
    """Return the intervals of all learned factors."""
    return {name: FactorRange(interval.low, interval.high) for name, interval in posterior.intervals.items()}


def _factor_range(values: Floats) -> FactorRange:
    """Return the 95 % range of samples over their mean."""
    low, high = np.quantile(values, INTERVAL_QUANTILES) / np.mean(values) if np.mean(values) > 0 else (1.0, 1.0)
    return FactorRange(min(float(low), 1.0), max(float(high), 1.0))


class LobesAtSpeed(NamedTuple):
    """Lobes of a cut by the zero-order approximation with the spindle at speed."""

    n_cuts: int
    """Number of test cuts that they were learned from."""
    lobes: StabilityLobes
    """Lobes of the learned median."""
    band: LimitBand
    """Remaining uncertainty band of the limits."""


def compute_lobes_at_speed(verdicts: Sequence[Verdict], machine: Machine) -> LobesAtSpeed | None:
    """Compute the lobes of programs with the same cut, or None without learned test cuts."""
    for verdict in verdicts:
        tool, name, at_speed = verdict.assembly, verdict.program.name, verdict.at_speed
        if tool is None or not at_speed.n_cuts:
            continue
        taught, spindle = msgspec.structs.replace(machine, all_programs=(verdict.program,)), at_speed.scale_modes(tool)
        lobes = compute_tip_lobes(spindle.tool, spindle.x, spindle.y, taught, [name], spindle.cross)[name]
        return LobesAtSpeed(at_speed.n_cuts, lobes, compute_limit_band(lobes, name, tool, taught, at_speed))
    return None
