"""Verdicts and lobes of a program with the spindle at speed, as learned from test cuts."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from acquisition import DataError
from lobes import StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.cuts.learning.cut_likelihood import CutEntries
from lobewatch.cuts.learning.pocket_depth import apply_test_cuts
from lobewatch.cuts.learning.posterior import Posterior, inconsistent_cut_remarks
from lobewatch.cuts.learning.program_learning import LearningResult, learn_program
from lobewatch.machine import CutTable, Machine, ProgramTable
from lobewatch.tool.assembly import Assembly, compute_tip_lobes
from lobewatch.verdicts.monte_carlo import LimitBand, compute_limit_band
from lobewatch.verdicts.program_case import NO_TEST_CUTS, SpindleAtSpeed, build_program
from lobewatch.verdicts.program_samples import N_PROGRAM_SAMPLES, build_median_row
from lobewatch.verdicts.uncertainty import FactorRange, LearnedSamples, Uncertainty
from lobewatch.verdicts.uncertainty_causes import TEST_CUTS
from lobewatch.verdicts.verdict import Verdict, evaluate_program

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
    remarks = tuple(inconsistent_cut_remarks(learning.posterior, learning.inconsistent_cuts, table.name))
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
    left = LearnedSamples(frequency, damping, stiffness, phases, force / np.mean(force), direction_over_mean)
    widths = {TEST_CUTS.name: _half_widths(parts, phases)}
    mixing, speed = np.tile(np.eye(4), (at_rest.direction.size, 1, 1)), machine.doubt.speed_percent / 100
    ranges, axes = (_factor_range(force), _factor_range(direction)), tool.principal_directions
    uncertainty = Uncertainty(widths, mixing, speed, *ranges, axes=axes, learned=left)
    return SpindleAtSpeed(
        n_cuts=len(learning.accepted_cuts),
        uncertainty=uncertainty,
        factors=np.stack(median, axis=1),
        tangential=float(at_rest.tangential[0]) * push / 1e6,
        radial=float(at_rest.radial[0]) * push * ratio / 1e6,
        prior_ranges=_factor_ranges(learning.prior),
        posterior_ranges=_factor_ranges(learning.posterior),
    )


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
