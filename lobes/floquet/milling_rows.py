"""Many milling systems of one kind, and the pieces their tooth period is divided into."""

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from lobes.cut import Cut
from lobes.milling_system import MillingSystem, tip_participation
from modal.arrays import Flags, Floats, Integers


@dataclass(frozen=True, eq=False)
class MillingRows:
    """Batch of r systems of n modes in the same p directions, each with its own speed, coefficients and feed angle."""

    cut: Cut
    """Teeth, immersion, direction of milling and helix of all rows; its coefficients and feed angle are ignored."""
    direction: Integers
    """Row of `axes` in which each mode was measured, shape (n,)."""
    axes: Integers
    """Compliant directions, 0 for x and 1 for y, shape (p,)."""
    frequency: Floats
    """Natural frequencies (rad/s), shape (r, n)."""
    damping_ratio: Floats
    """Damping ratios, shape (r, n)."""
    stiffness: Floats
    """Stiffnesses at the tool tip along their directions (N/m), shape (r, n)."""
    phase: Floats
    """Phases of the modal constants (rad), shape (r, n); 0 for real modes."""
    vector: Floats
    """Directions of the modes in `axes`, shape (r, n, p): share of force and response. 1 and 0 along an axis."""
    speed_rpm: Floats
    """Spindle speeds (rpm), shape (r,)."""
    tangential: Floats
    """Cutting coefficients Kt (Pa), shape (r,)."""
    radial: Floats
    """Cutting coefficients Kr (Pa), shape (r,)."""
    feed_angle: Floats
    """Angles from x to the feed (rad), shape (r,)."""
    process_damping: Floats
    """Process damping coefficients over cutter diameter C / D (Pa), shape (r,)."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return self.speed_rpm.size

    def __getitem__(self, which: Any) -> Self:
        """Select rows by an index array or a mask."""
        return replace(self, **{name: getattr(self, name)[which] for name in _VARYING_FIELDS})

    def with_feed_angle(self, angle: float) -> Self:
        """Return all rows with one feed angle.

        Parameters
        ----------
        angle : float
            Angle from x to the feed (rad).
        """
        return replace(self, feed_angle=np.full(len(self), angle))

    def with_cut(self, cut: Cut) -> Self:
        """Return all rows with the teeth, immersion and feed of a cut; their coefficients stay.

        Parameters
        ----------
        cut : Cut
            New cut.
        """
        return replace(self, cut=cut).with_feed_angle(cut.feed_angle)

    @property
    def tip_participation(self) -> tuple[Floats, Floats]:
        """Shares of each mode's coordinate q and velocity q' / w in the tip displacement, each of shape (r, n)."""
        return tip_participation(self.damping_ratio, self.phase)

    @property
    def damping_per_depth(self) -> Floats:
        """Process damping per depth C / V (N s/m^2), shape (r,)."""
        return np.asarray(self.process_damping * 60 / (np.pi * self.speed_rpm))

    @property
    def tooth_period(self) -> Floats:
        """Mean time between two teeth (s), shape (r,)."""
        return np.asarray(60 / (self.cut.teeth * self.speed_rpm))

    @property
    def period(self) -> Floats:
        """Time after which the cut repeats (s), shape (r,): the tooth period of evenly spaced teeth."""
        return self.tooth_period * len(self.cut.pitch_pattern)


_FIELDS_OF_CUT = ("tangential", "radial", "feed_angle", "process_damping")
_VARYING_FIELDS = [field.name for field in fields(MillingRows) if field.name not in ("cut", "direction", "axes")]


def join_rows(first: MillingRows, second: MillingRows) -> MillingRows:
    """Join two batches of the same cut and modes.

    Parameters
    ----------
    first, second : MillingRows
        Batches.

    Returns
    -------
    MillingRows
        Rows of both.
    """
    columns: dict[str, Any] = {n: np.concatenate((getattr(first, n), getattr(second, n))) for n in _VARYING_FIELDS}
    return replace(first, **columns)


def rows_at_speeds(system: MillingSystem, cut: Cut, speed_rpm: Floats) -> MillingRows:
    """Return one system and cut at many speeds.

    Parameters
    ----------
    system : MillingSystem
        Modes of the tool tip.
    cut : Cut
        Cutter, immersion and material.
    speed_rpm : ndarray, shape (r,)
        Spindle speeds (rpm).

    Returns
    -------
    MillingRows
        One row per speed.

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> rows = rows_at_speeds(build_milling_system([mode], None), slot, np.array([6000.0, 12000.0]))
    >>> (rows.tooth_period * 1e3).tolist()  # ms
    [5.0, 2.5]
    """
    ones = np.ones((speed_rpm.size, 1))
    return MillingRows(
        cut=cut,
        direction=system.direction,
        axes=system.axes,
        **{name: ones * getattr(system, name) for name in ("frequency", "damping_ratio", "phase")},
        stiffness=ones * (system.frequency / system.shape) ** 2,
        vector=np.tile(system.vector, (speed_rpm.size, 1, 1)),
        speed_rpm=speed_rpm,
        **{name: np.full(speed_rpm.shape, getattr(cut, name)) for name in _FIELDS_OF_CUT},
    )


MAX_CYCLES_PER_PIECE = 0.75
"""Most cycles of the fastest significant mode per piece: multipliers within 1e-6 of the exact ones."""
COARSE_CYCLES_PER_PIECE = 1.0
"""Most cycles per piece if growth within 1e-4 is enough, as for Monte Carlo samples."""
PIECE_NUMBER_RATIO = 1.3
"""Ratio of large numbers of pieces, so that neighbouring speeds share theirs."""
MIN_LOOP_GAIN = 0.1
"""Least depth times force times largest flexibility of a significant mode, 1 / (2 K zeta) of a real one.

A loop with less gain cannot sustain itself at any speed.
"""
MIN_SEGMENT_SHARE = 1e-12
"""Least length of a segment over the pattern."""


def segment_ends(cut: Cut, depth: Floats) -> Floats:
    """Return the angles where the force begins, ends or bends over one pitch pattern, rising (rad).

    They start at a tooth's entry. depth (c,) in m matters for helical teeth only: they leave later at the other end of
    the tip. Shape (c, k + 1).
    """
    turn = sum(cut.pitch_pattern)
    entries = -cut.lead_angles[: len(cut.pitch_pattern)]
    lag = cut.helix_lag * depth[:, np.newaxis]
    arc = np.full(lag.shape, cut.exit_angle - cut.entry_angle)
    bends = arc if cut.helix_lag == 0 else np.hstack((lag, arc, arc + lag))
    after = (bends[:, :, np.newaxis] + entries).reshape(depth.size, -1)
    edge = np.zeros((depth.size, 1))
    inside = np.hstack((edge + entries[1:], np.mod(after, turn)))
    return np.hstack((edge, np.sort(inside, axis=1), edge + turn))


def is_out_of_cut(cut: Cut, ends: Floats, depth: Floats) -> Flags:
    """Return whether no tooth cuts in the segments between these ends (c, k + 1), shape (c, k)."""
    reach = cut.exit_angle - cut.entry_angle + cut.helix_lag * depth[:, np.newaxis, np.newaxis]
    middle = (ends[:, :-1, np.newaxis] + ends[:, 1:, np.newaxis]) / 2
    return np.asarray(np.all(np.mod(middle + cut.lead_angles, 2 * np.pi) > reach, axis=-1))


def count_pieces(rows: MillingRows, deepest: float, most: float = MAX_CYCLES_PER_PIECE) -> Integers:
    """Return the number of pieces of the pitch pattern that each row needs.

    Parameters
    ----------
    rows : MillingRows
        Batch of systems.
    deepest : float
        Largest axial depth (m).
    most : float
        Most cycles of the fastest significant mode per piece (-).

    Returns
    -------
    ndarray of int, shape (r,)
        Numbers of pieces.
    """
    dynamic_stiffness = 2 * rows.stiffness * rows.damping_ratio
    force = np.hypot(rows.tangential, rows.radial)[:, np.newaxis]  # largest possible entry of the matrix of a tooth
    loop = deepest * force / dynamic_stiffness * np.hypot(*rows.tip_participation)
    loop = loop * np.sum(rows.vector**2, axis=-1)
    significant = np.where(loop > MIN_LOOP_GAIN, rows.frequency, 0.0)
    fastest = np.maximum(np.max(significant, axis=1), np.min(rows.frequency, axis=1))
    cycles = fastest / (2 * np.pi) * rows.period
    return np.asarray(np.ceil(np.maximum(cycles / most, 1.0)), dtype=np.int64)


def divide_segments(cut: Cut, number: Integers, ends: Floats) -> Integers:
    """Return the pieces of each segment (c, k) for the pieces of the whole pattern (c,); 0 for an empty one.

    None is longer than the shortest delay: the surface that a tooth meets must be known.
    """
    share = np.diff(ends, axis=1) / ends[:, -1:]
    wanted = np.maximum(number[:, np.newaxis] * share, np.maximum(share * sum(cut.pitch_pattern) / cut.delays[0], 1.0))
    power = np.ceil(np.log(wanted) / np.log(PIECE_NUMBER_RATIO) - 1e-9)
    rounded = np.where(wanted <= 4, np.ceil(wanted - 1e-9), np.ceil(PIECE_NUMBER_RATIO**power - 1e-9))
    return np.where(share > MIN_SEGMENT_SHARE, rounded, 0).astype(np.int64)
