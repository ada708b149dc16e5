"""A milling cut, and the tables of its modes and teeth for time stepping."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Complexes, Floats
from acquisition.emulation.hammered_structure import Structure


@dataclass(frozen=True, eq=False)
class MillingCut:
    """Milling cut and the machine that makes it. Conventions are those of `lobes.Cut`.

    x and y are axes of the machine, x along the feed at feed_angle = 0. The tooth angle runs clockwise from the normal
    of the feed (rad). Invalid values raise ValueError.
    """

    teeth: int
    """Number of teeth."""
    entry_angle: float
    """Angle at which a tooth enters the cut (rad), 0 to pi."""
    exit_angle: float
    """Angle at which a tooth leaves the cut (rad), entry_angle to pi."""
    tangential: float
    """Tangential cutting coefficient Kt (Pa)."""
    radial: float
    """Radial cutting coefficient Kr (Pa)."""
    depth: float
    """Axial depth of cut ap (m)."""
    feed_per_tooth: float
    """Feed per tooth (m)."""
    speed_rpm: float
    """True spindle speed (rpm)."""
    x: Structure | None
    """Modes of the rotating tip in x without residual, None for rigid."""
    y: Structure | None
    """Modes of the rotating tip in y without residual, None for rigid."""
    runout: tuple[float, ...] = ()
    """Run-out of each tooth (m), `teeth` values, empty for none."""
    tangential_edge: float = 0.0
    """Tangential edge force coefficient Kte (N/m), acting wherever the edge is in the arc of cut."""
    radial_edge: float = 0.0
    """Radial edge force coefficient Kre (N/m)."""
    helix_lag: float = 0.0
    """Lag of a helical tooth along the axis (rad/m), 0 for straight teeth."""
    feed_angle: float = 0.0
    """Angle from x to the feed (rad)."""
    pitch: tuple[float, ...] = ()
    """Angle from each tooth to the one before it (rad), in order of entry. () for evenly spaced teeth."""

    def __post_init__(self) -> None:
        if self.teeth < 1 or self.teeth != int(self.teeth):
            raise ValueError(f"teeth={self.teeth} is not a whole number >= 1")
        if not 0 <= self.entry_angle < self.exit_angle <= np.pi + 1e-9:
            angles = f"entry_angle={self.entry_angle} and exit_angle={self.exit_angle} rad"
            raise ValueError(f"{angles} must be 0 <= entry_angle < exit_angle <= pi")
        above = (self.tangential, self.depth, self.feed_per_tooth, self.speed_rpm)
        if not (min(above) > 0 and sum(above) < np.inf):
            text = f"tangential={self.tangential} Pa, depth={self.depth} m, feed_per_tooth={self.feed_per_tooth} m"
            raise ValueError(f"{text} and speed_rpm={self.speed_rpm} must be finite and above 0")
        least = (self.radial, self.tangential_edge, self.radial_edge, self.helix_lag)
        if not (min(least) >= 0 and sum(least) < np.inf):
            raise ValueError(f"radial, tangential_edge, radial_edge, helix_lag = {least} must be finite and at least 0")
        if len(self.runout) not in (0, self.teeth):
            raise ValueError(f"runout has {len(self.runout)} values. Give one per tooth ({self.teeth}), or no runout.")
        is_turn = abs(sum(self.pitch) - 2 * np.pi) < 1e-6
        if self.pitch and not (len(self.pitch) == self.teeth and min(self.pitch) > 0 and is_turn):
            cure = f"Give {self.teeth} values above 0, one per tooth, with the sum 2 pi."
            raise ValueError(f"pitch={self.pitch} rad is invalid. {cure}")
        if self.x is None and self.y is None:
            raise ValueError("x and y are both rigid. Give the modes of at least one direction.")

    @property
    def tooth_period(self) -> float:
        """Mean tooth period (s)."""
        return 60 / (self.teeth * self.speed_rpm)


@dataclass(frozen=True)
class Passage:
    """Passage of the tool through the part. ValueError for negative times and for no cut."""

    before: float = 0.4
    """Time in air before the cut (s)."""
    ramp: float = 0.05
    """Time in which the depth grows from 0 to full, and in which it falls again (s)."""
    steady: float = 1.1
    """Time at full depth (s)."""
    after: float = 0.2
    """Time in air after the cut (s)."""

    def __post_init__(self) -> None:
        if not (min(self.before, self.ramp, self.steady, self.after) >= 0 and self.cutting > 0):
            raise ValueError(f"{self} is invalid. Give times of 0 or more, and a ramp or steady time above 0.")

    def depth_at(self, time: Floats) -> Floats:
        """Return the share of the full depth.

        Parameters
        ----------
        time : ndarray
            Times since first contact (s).
        """
        times = [0.0, self.ramp, self.ramp + self.steady, self.cutting]
        return np.interp(time, times, [float(self.ramp == 0), 1.0, 1.0, 0.0])

    @property
    def cutting(self) -> float:
        """Time from first to last contact (s)."""
        return 2 * self.ramp + self.steady


MIN_STEPS_PER_CYCLE, MIN_STEPS_PER_TOOTH_PERIOD, MIN_STEPS_PER_ARC = 16, 30, 16
"""Fewest steps per cycle of the fastest mode (as stiffened by the cut), per tooth period, and per arc of cut."""
MIN_STEP_RATE = 60e3
"""Lowest step rate (Hz). A device without a filter also records content above half its sample rate."""
MAX_SLICE_LAG = 0.15
"""Largest lag between two slices of a helical tooth (rad)."""


def count_steps_needed(cut: MillingCut) -> int:
    """Return the steps per tooth period that a cut needs."""
    pitch, arc = 2 * np.pi / cut.teeth, cut.exit_angle - cut.entry_angle
    cutting = cut.depth * math.hypot(cut.tangential, cut.radial) * math.ceil(arc / pitch)
    sides = [side for side in (cut.x, cut.y) if side is not None]
    fastest = max(float(np.max(side.frequency * np.sqrt(1 + cutting / side.stiffness))) for side in sides)
    rate = max(MIN_STEPS_PER_CYCLE * fastest, MIN_STEP_RATE)
    return math.ceil(max(rate * cut.tooth_period, MIN_STEPS_PER_TOOTH_PERIOD, MIN_STEPS_PER_ARC * pitch / arc))


class ModeTables(NamedTuple):
    """Modes m of cuts c. A real mode is z = (q' + zeta w q) / w_d + i q, so that free vibration is a factor."""

    pole: Complexes
    """Poles -zeta w + i w_d (rad/s), shape (c, m). 0 if a cut has fewer modes."""
    flight: Complexes
    """Factor of z over a step, shape (c, m)."""
    axis: Floats
    """Motion of the tip along x and y of the machine by each mode, shape (c, 2, m)."""
    step: Floats
    """Step length (s), shape (c,)."""


class ToothTables(NamedTuple):
    """Teeth (and slices of helical ones) e in the cut at each step s, of cuts c.

    Chip and force each carry the square root of the share of a step and of the depth in which the tooth cuts.
    """

    root: Floats
    """Square root of that share, shape (s, c, e). 0 if fewer are in the cut."""
    rigid_chip: Floats
    """Chip of a rigid tool (m), shape (s, c, e)."""
    pitch_index: NDArray[np.int64]
    """Index of the pitch after angle 0 that the tooth is in, shape (s, c, e)."""
    reach: Floats
    """Depth by which each mode's displacement moves a tooth into the part, shape (s, c, e, m)."""
    chip_gain: Floats
    """Gain of z.real in a step from each chip at full depth, shape (s, c, m, e)."""
    edge_gain: Floats
    """Gain of z.real in a step from all edges in the cut, shape (s, c, m)."""


def build_tables(cuts: Sequence[MillingCut], steps: int) -> tuple[ModeTables, ToothTables]:
    """Build the tables of cuts for this number of steps per tooth period."""
    pole, axis, shape, kick, rub = _stack_padded([_build_mode_arrays(cut, cut.tooth_period / steps) for cut in cuts], 0)
    root, place, normal = _stack_padded([_find_teeth_in_cut(cut, steps) for cut in cuts], 1)
    step = np.array([cut.tooth_period / steps for cut in cuts])
    thick = normal[:, :, 0] * np.array([[cut.feed_per_tooth] for cut in cuts])
    reach = np.swapaxes(normal, -1, -2) @ shape
    push = np.swapaxes(kick, -1, -2) @ normal
    edges = np.swapaxes(rub, -1, -2) @ np.sum(normal * root[:, :, np.newaxis], axis=-1, keepdims=True)
    modes = ModeTables(pole, np.exp(pole * step[:, np.newaxis]), axis, step)
    return modes, ToothTables(root, thick, place, reach, push, edges[..., 0])


def _stack_padded(of_cuts: Sequence[tuple[NDArray[Any], ...]], axis: int) -> list[Any]:
    """Stack the arrays of each cut along a new axis, padded with zeros along the last one."""
    most = max(arrays[0].shape[-1] for arrays in of_cuts)
    padded = [[np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, most - a.shape[-1])]) for a in cut] for cut in of_cuts]
    return [np.stack(same, axis=axis) for same in zip(*padded, strict=True)]


def _build_mode_arrays(cut: MillingCut, step: float) -> tuple[NDArray[Any], ...]:
    """Return poles (m,); axes, shapes along feed and normal, gains from chips and from edges, each (2, m)."""
    rigid = Structure(np.empty(0), np.empty(0), np.empty(0))
    x, y = cut.x or rigid, cut.y or rigid
    w = 2 * np.pi * np.concatenate([x.frequency, y.frequency])
    zeta, k = np.concatenate([x.damping_ratio, y.damping_ratio]), np.concatenate([x.stiffness, y.stiffness])
    damped = w * np.sqrt(1 - zeta**2)
    axis = np.repeat(np.eye(2), [x.frequency.size, y.frequency.size], axis=1)
    c, s = math.cos(cut.feed_angle), math.sin(cut.feed_angle)
    shape = np.array([[c, s], [-s, c]]) @ axis
    kick, rub = (
        -cut.depth * np.array([[radial, -tangential], [tangential, radial]]) @ shape * step * w**2 / (k * damped)
        for tangential, radial in ((cut.tangential, cut.radial), (cut.tangential_edge, cut.radial_edge))
    )
    return -zeta * w + 1j * damped, axis, shape, kick, rub


def _find_teeth_in_cut(cut: MillingCut, steps: int) -> tuple[NDArray[Any], ...]:
    """Return root of the share and pitch index (s, e), and outward normal times root (s, 2, e)."""
    slices = max(1, math.ceil(cut.helix_lag * cut.depth / MAX_SLICE_LAG))
    lag = cut.helix_lag * cut.depth * (np.arange(slices) + 0.5) / slices
    step = 2 * np.pi / (cut.teeth * steps)
    place, late = (grid.ravel() for grid in np.meshgrid(np.arange(cut.teeth), lag, indexing="ij"))
    first = np.mod(step * (np.arange(steps)[:, np.newaxis] + steps * place) - late + step, 2 * np.pi) - step
    begin, end = np.maximum(first, cut.entry_angle), np.minimum(first + step, cut.exit_angle)
    share = np.maximum(end - begin, 0) / (step * slices)
    most = max(1, int(np.max(np.count_nonzero(share, axis=1))))
    inside = np.argsort(share == 0, axis=1, kind="stable")[:, :most]
    root = np.sqrt(np.take_along_axis(share, inside, 1))
    angle = np.take_along_axis((begin + end) / 2, inside, 1)
    return root, place[inside], np.stack([np.sin(angle), np.cos(angle)], axis=1) * root[:, np.newaxis]
