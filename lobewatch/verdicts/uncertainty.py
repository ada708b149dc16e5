"""Uncertainty of a program by cause, and Monte Carlo samples drawn from it.

Half-widths of independent uniform distributions, or posterior samples where test cuts have been learned from.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from lobes import MillingRows
from lobes.coefficient_distribution import JointCoefficients
from lobes.materials import find_joint_coefficients
from lobewatch.arrays import Floats
from lobewatch.machine import CutTable, Machine, ProgramTable, ToolWear, UncertaintyTable
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.principal_directions import PrincipalDirections
from lobewatch.tool.tap_series import Scatter
from lobewatch.verdicts import uncertainty_causes as causes
from modal import Mode

DEFAULT_TAP_SCATTER = Scatter(0.003, 0.10, 0.03)
"""Default scatter between tap tests, until a series has its own; chosen."""
MIN_SAMPLE_FACTOR = 0.02
"""Smallest factor of a sample on a median value."""
MAX_MODE_PHASE = np.radians(89)
"""Largest phase of a sample (rad)."""
WEAR_FACTORS: Mapping[ToolWear, float] = {"new": 1.0, "used": 1.3, "worn": 1.6}
"""Largest factor on the cutting coefficients by tool wear; chosen."""
WORN_LAND_UM = 300.0
"""Width of the wear land of a worn edge (um): assumed, as the end of tool life quoted from ISO 8688-2."""


RecordT = TypeVar("RecordT", MillingRows, Mode)
Factors = Floats | float
"""Factors of several rows, or of all."""


def scale_fields(record: RecordT, **factors: Factors) -> RecordT:
    """Multiply fields of a record by factors."""
    return replace(record, **{name: getattr(record, name) * factor for name, factor in factors.items()})


class FactorRange(NamedTuple):
    """Lowest and highest value of a quantity, as factors on its median or on the value not rotating."""

    low: float
    """Lowest factor."""
    high: float
    """Highest factor."""


NOT_DAMPED = np.zeros(1)
"""No process damping."""


class LearnedSamples(NamedTuple):
    """Spindles at speed that explain the test cuts, r of equal weight, around their mean; n modes in x, then y."""

    frequency: Floats
    """Natural frequencies over their mean, shape (r, n)."""
    damping_ratio: Floats
    """Damping ratios over their mean, shape (r, n)."""
    stiffness: Floats
    """Modal stiffnesses over their mean, shape (r, n)."""
    phase_change: Floats
    """Phases relative to the mean phases (rad), shape (r, n)."""
    tangential: Floats
    """Kt over its mean, shape (r,)."""
    ratio: Floats
    """Kr/Kt over its mean, shape (r,)."""
    process_damping: Floats = NOT_DAMPED
    """Process damping coefficients over cutter diameter C / D (Pa), shape (r,), or (1,) if all are alike."""

    def build_rows(self, median: MillingRows, count: int, without: str) -> MillingRows:
        """Build samples around a median (a row), at its speed; without: a cause that is left out."""
        take = np.arange(count) % len(self.tangential)
        rows, spindle = median[np.zeros(count, dtype=np.intp)], float(without != causes.TEST_CUTS.name)
        is_counted = without != causes.COEFFICIENTS.name
        force, direction = (1 + (factor[take] - 1) * is_counted for factor in (self.tangential, self.ratio))
        factors = self.frequency, self.damping_ratio, self.stiffness
        f, zeta, k = (1 + (factor[take] - 1) * spindle for factor in factors)
        rows = scale_fields(rows, frequency=f, damping_ratio=zeta, stiffness=k, tangential=force, radial=force)
        damping = np.broadcast_to(self.process_damping, self.tangential.shape)[take]
        damping = damping if is_counted else rows.process_damping
        phase = rows.phase + self.phase_change[take] * spindle
        return replace(rows, phase=phase, radial=rows.radial * direction, process_damping=damping)


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Uncertainty of a program, by what it comes from."""

    modes: Mapping[str, Floats]
    """Half-widths of frequency, damping ratio and stiffness (relative) and phase (rad) of the modes in x, then y,
    shape (n, 4), by cause: "tap" (the error of the tap test), "clamping" (from tap test to tap test), "prediction"
    (a tool that was never tapped), "untapped" (a direction that was not), "cuts" (what test cuts have left open)."""
    tap_correlation: Floats
    """Roots of the correlations of the error of the tap test, lower triangular, shape (n, 4, 4); 1 where none count."""
    speed: float
    """Relative half-width of the spindle speed."""
    tangential: FactorRange
    """Range of the cutting coefficient Kt over the median."""
    ratio: FactorRange
    """Range of Kr/Kt, the direction of the force, over the median."""
    wear: float = 1.0
    """Largest factor on both cutting coefficients by edges that are no longer new, drawn with the largest Kt; the
    least is 1."""
    axes: PrincipalDirections | None = None
    """Principal directions of the modes and their open signs; None if they are known."""
    learned: LearnedSamples | None = None
    """Posterior samples of test cuts, used instead of the half-widths; None if nothing was learned."""
    joint: JointCoefficients | None = None
    """Joint distribution of Kt and Kr/Kt over their medians, of a listed material; None: even within the ranges."""

    def __post_init__(self) -> None:
        """Reject causes without a record in `UNCERTAINTY_CAUSES`."""
        if unknown := self.modes.keys() - causes.UNCERTAINTY_CAUSES.keys():
            raise ValueError(f"unknown causes of uncertainty: {', '.join(sorted(unknown))}")

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of all causes."""
        across = [causes.CROSS.name] if self.axes is not None and self.axes.are_uncertain else []
        worn = [causes.WEAR.name] if self.wear > 1 else []
        return (*self.modes, *across, causes.SPEED.name, causes.COEFFICIENTS.name, *worn)

    def coefficient_factors(self, even: Floats) -> tuple[Floats, Floats]:
        """Return factors of Kt and Kr/Kt for independent even probabilities (2, r), shape (r,) each."""
        if self.joint is not None:
            return self.joint.at(even)
        spans = zip((self.tangential, self.ratio), even, strict=True)
        tangential, ratio = (span.low + (span.high - span.low) * share for span, share in spans)
        return tangential, ratio

    def sample(self, median: MillingRows, count: int, seed: int = 0, without: str = "") -> MillingRows:
        """Sample systems within the uncertainty, reproducible by seed.

        Parameters
        ----------
        median
            Median system, one row.
        count
            Number of samples.
        seed
            Seed of the random numbers; the other causes have the same samples whatever is left out.
        without
            Name of a cause that is left out.

        Returns
        -------
        MillingRows
            Sampled systems, `count` rows.
        """
        random = np.random.default_rng(seed)
        if self.learned is None:
            rows = self._sample_modes(median[np.zeros(count, dtype=np.intp)], random, seed, without)
        else:
            rows = self.learned.build_rows(median, count, without)
        speed = 1 + self.speed * random.uniform(-1, 1, count) * (without != causes.SPEED.name)
        rows = scale_fields(rows, speed_rpm=np.maximum(speed, MIN_SAMPLE_FACTOR))
        if self.learned is None:
            rows = self._sample_coefficients(rows, random, without)
        if self.axes is not None and self.axes.are_uncertain and without != causes.CROSS.name:
            rows = replace(rows, vector=self.axes.sample(count, seed))
        if self.wear == 1 or without == causes.WEAR.name:
            return rows
        worn = np.empty(count)
        worn[np.argsort(rows.tangential, kind="stable")] = np.linspace(1, self.wear, count)
        return scale_fields(rows, tangential=worn, radial=worn)

    def _sample_modes(self, rows: MillingRows, random: np.random.Generator, seed: int, without: str) -> MillingRows:
        phases = np.random.default_rng((seed, 1))
        factor, turned = np.ones((*rows.frequency.shape, 3)), np.zeros(rows.frequency.shape)
        for cause, widths in self.modes.items():
            uniform = random.uniform(-1, 1, factor.shape), phases.uniform(-1, 1, (*turned.shape, 1))
            numbers = np.concatenate(uniform, axis=-1)
            if cause == causes.TAP_TEST.name:
                numbers = np.einsum("nij,cnj->cni", self.tap_correlation, numbers)
            moved = widths * numbers
            if cause != without:
                factor *= np.maximum(1 + moved[..., :3], MIN_SAMPLE_FACTOR)
                turned += moved[..., 3]
        rows = scale_fields(rows, frequency=factor[..., 0], damping_ratio=factor[..., 1], stiffness=factor[..., 2])
        return replace(rows, phase=np.clip(rows.phase + turned, -MAX_MODE_PHASE, MAX_MODE_PHASE))

    def _sample_coefficients(self, rows: MillingRows, random: np.random.Generator, without: str) -> MillingRows:
        tangential, ratio = self.coefficient_factors(random.uniform(0, 1, (2, len(rows))))
        if without == causes.COEFFICIENTS.name:
            return rows
        push = np.maximum(tangential, MIN_SAMPLE_FACTOR)
        return scale_fields(scale_fields(rows, tangential=push, radial=push), radial=np.maximum(ratio, 0.0))


def uncertainty_of(assembly: Assembly, table: CutTable, machine: Machine) -> Uncertainty:
    """Determine the uncertainty of a cut with a tool that does not rotate.

    Parameters
    ----------
    assembly
        Tool as tapped or predicted.
    table
        Program or reference cut.
    machine
        Machine with its [doubt] table and materials.

    Returns
    -------
    Uncertainty
        Half-widths by cause, and ranges of the cutting coefficients.
    """
    mixing = np.array([_tap_correlation(mode) for mode in (*(assembly.x or ()), *(assembly.y or ()))])
    speed, (tangential, ratio, joint) = machine.doubt.speed_percent / 100, _coefficient_ranges(table, machine)
    axes, wear = assembly.principal_directions, _wear_factor(table, machine)
    modes = _mode_uncertainty(assembly, machine.doubt)
    return Uncertainty(modes, mixing, speed, tangential, ratio, wear, axes, joint=joint)


def _wear_factor(table: CutTable, machine: Machine) -> float:
    """Return the largest factor on the cutting coefficients by the wear of a cut, or by its wear land if larger."""
    if not isinstance(table, ProgramTable):
        return WEAR_FACTORS[machine.doubt.wear]
    by_land = 1 + (WEAR_FACTORS["worn"] - 1) * (table.wear_land_um or 0.0) / WORN_LAND_UM
    return max(WEAR_FACTORS[table.wear or machine.doubt.wear], by_land)


def _mode_uncertainty(assembly: Assembly, given: UncertaintyTable) -> dict[str, Floats]:
    """Return half-widths of the modes by cause, shape (n, 4) each."""
    x, y = assembly.x or (), assembly.y or ()
    absent = np.zeros((len(x) + len(y), 4))
    if assembly.predicted:
        percents = given.predicted_frequency_percent, given.predicted_damping_percent, given.predicted_stiffness_percent
        sizes = [percent / 100 for percent in percents]
        widths = {causes.PREDICTION.name: np.array([(*sizes, abs(np.radians(mode.phase_deg))) for mode in (*x, *y)])}
    else:
        sides = (("x", len(x)), ("y", len(y)))
        clamping = np.vstack([np.tile(tap_scatter_of(assembly, side, given), (count, 1)) for side, count in sides])
        clamping = clamping * [1, 1, 1, np.pi / 180]
        widths = {causes.TAP_TEST.name: np.array([_tap_error(mode) for mode in (*x, *y)])}
        widths[causes.CLAMPING.name] = clamping
    if len(assembly.directions) == 1:
        unknown = slice(len(x), None) if assembly.directions[0] == "x" else slice(0, len(x))
        widths[causes.UNTAPPED.name] = absent
        absent[unknown] = given.untapped_frequency_percent / 100, 0.0, given.untapped_stiffness_percent / 100, 0.0
    return widths


def tap_scatter_of(assembly: Assembly, side: str, given: UncertaintyTable) -> Scatter:
    """Return the scatter of the tap tests of a tool in a direction: machine.toml, else the series, else the default."""
    scatter = assembly.scatter(side if side in assembly.directions else assembly.directions[0]) or DEFAULT_TAP_SCATTER
    percents = (given.frequency_percent, given.damping_percent, given.stiffness_percent)
    sizes = [width if wish is None else wish / 100 for width, wish in zip(scatter[:3], percents, strict=True)]
    return Scatter(sizes[0], sizes[1], sizes[2], scatter.phase_deg)


def _tap_error(mode: Mode) -> Floats:
    """Return the 95 % error of the tap test, relative, of the phase in rad; 0 where it is unknown."""
    values = np.array([mode.frequency, mode.damping_ratio, mode.stiffness, 180 / np.pi])
    return np.asarray(np.nan_to_num(mode.quantile() * np.append(mode.standard_error, mode.phase_deg_std) / values))


def _tap_correlation(mode: Mode) -> Floats:
    """Return the root of the error correlations of a mode whose phase was fitted, shape (4, 4); else 1."""
    error = np.sqrt(np.diag(mode.joint_covariance))
    if not np.all(error > 0):
        return np.eye(4)
    value, vector = np.linalg.eigh(mode.joint_covariance / np.outer(error, error))
    _, triangle = np.linalg.qr((vector * np.sqrt(np.maximum(value, 0.0))).T)
    return np.asarray((triangle * np.where(np.diag(triangle) < 0, -1.0, 1.0)[:, np.newaxis]).T)


def _coefficient_ranges(table: CutTable, machine: Machine) -> tuple[FactorRange, FactorRange, JointCoefficients | None]:
    """Return the ranges of Kt and Kr/Kt, published, else by [doubt], and their joint distribution, over the medians."""
    known = machine.coefficients(table)
    if known.tangential_range is None or known.ratio_range is None:
        share = machine.doubt.coefficients_percent / 100
        return FactorRange(1 - share, 1 + share), FactorRange(1 - share, 1 + share), None
    ratio, joint = known.radial / known.tangential, find_joint_coefficients(known)
    tangential = FactorRange(*(limit / known.tangential for limit in known.tangential_range))
    ratios = FactorRange(*(limit / ratio for limit in known.ratio_range))
    return tangential, ratios, joint and joint.over(known.tangential, ratio)
