"""Stable pockets between the lobes, and how they move."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lobes.stability_lobes import StabilityLobes
from modal.arrays import Floats, Indices


def find_curve_peaks(values: Floats, prominence: float) -> Indices:
    """Return the indices of the peaks of a curve (n,), n > 0, with at least this prominence.

    As `scipy.signal.find_peaks`, which takes longer to import than this package. The prominence is the height above the
    higher of the two lowest points between a peak and higher values on either side, or the end. A flat top counts at
    its
    middle, rounded down. The ends of the curve are no peaks.
    """
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    ends = np.concatenate((starts[1:], [values.size])) - 1
    height = values[starts]
    tops = (np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] > height[2:])) + 1).tolist()
    bases = [max(_peak_base(height, top, -1), _peak_base(height, top, 1)) for top in tops]
    kept = [top for top, base in zip(tops, bases, strict=True) if height[top] - base >= prominence]
    return np.asarray((starts[kept] + ends[kept]) // 2)


def _peak_base(height: Floats, top: int, step: int) -> float:
    """Return the lowest point on one side of a peak before something higher, or before the end."""
    side = height[top::step]
    higher = np.flatnonzero(side > height[top])
    return float(np.min(side[: higher[0]] if higher.size else side))


POCKET_DEPTH_SHARE = 0.8
"""Limit at the ends of a pocket over its depth."""


class Pocket(NamedTuple):
    """Stable pocket of a diagram."""

    speed_rpm: float
    """Speed of the deepest point (rpm), the middle of a flat one."""
    depth: float
    """Limit at that speed (m), at most the deepest cut of interest."""
    from_rpm: float
    """Lowest speed with 80 % of the depth or more (rpm)."""
    to_rpm: float
    """Highest speed with 80 % of the depth or more (rpm); at most the end of the speed range."""


class PocketShift(NamedTuple):
    """Pocket before and after a change."""

    before: Pocket
    """Pocket before."""
    after: Pocket
    """Pocket after."""

    @property
    def speed_change(self) -> float:
        """Relative change of the speed (-)."""
        return self.after.speed_rpm / self.before.speed_rpm - 1

    @property
    def depth_change(self) -> float:
        """Relative change of the depth (-)."""
        return self.after.depth / self.before.depth - 1


def find_pockets(lobes: StabilityLobes, deepest: ArrayLike) -> list[Pocket]:
    """Find all stable pockets of a diagram in the order of speed.

    A pocket at an end of the speed range counts with the part inside.

    Parameters
    ----------
    lobes : StabilityLobes
        Diagram.
    deepest : array_like
        Deepest cut of interest (m), a number or shape (n,), as flutes or drive (`max_depth_for_drive`) allow.

    Returns
    -------
    list of Pocket
        Pockets, cut off at `deepest`.

    Raises
    ------
    ValueError
        For a `deepest` that is not > 0.

    Examples
    --------
    The fastest pocket has the tooth frequency equal to the natural frequency, at 60 f / N = 15000 rpm:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = zero_order_lobes([mode], [mode], slot, np.linspace(4000.0, 18000.0, 701))
    >>> for pocket in find_pockets(lobes, deepest=5e-3)[1:]:  # the first is cut by the end of the speeds
    ...     print(f"{pocket.from_rpm:.0f} to {pocket.to_rpm:.0f} rpm: {pocket.depth * 1e3:.2f} mm")
    4841 to 5116 rpm: 5.00 mm
    7011 to 7860 rpm: 5.00 mm
    12707 to 16955 rpm: 5.00 mm
    """
    order = np.argsort(lobes.speed_rpm)
    most = np.broadcast_to(np.asarray(deepest, dtype=np.float64), lobes.speed_rpm.shape)[order]
    if not np.all(np.isfinite(most) & (most > 0)):
        raise ValueError(f"deepest={deepest!r} m is not finite and > 0. Give the largest depth of cut of interest.")
    speed, depth = lobes.speed_rpm[order], np.minimum(lobes.depth[order], most)
    padded = np.concatenate(([0.0], depth, [0.0]))
    tops = find_curve_peaks(padded, prominence=0.05 * depth.min()) - 1
    return [Pocket(float(speed[i]), float(depth[i]), *_pocket_ends(speed, depth, i)) for i in tops]


def _pocket_ends(speed: Floats, depth: Floats, peak: int) -> tuple[float, float]:
    """Return the speeds on each side of a peak where the depth falls to 80 % of it, by linear interpolation."""
    level = POCKET_DEPTH_SHARE * depth[peak]
    low = np.flatnonzero(depth < level)
    before, after = low[low < peak], low[low > peak]
    left = [before[-1], before[-1] + 1] if before.size else [0]
    right = [after[0], after[0] - 1] if after.size else [-1]
    slowest, fastest = (float(np.interp(level, depth[sides], speed[sides])) for sides in (left, right))
    return slowest, fastest


def rank_pockets(found: Sequence[Pocket], count: int = 3, by: str = "depth") -> list[Pocket]:
    """Return the best pockets first.

    Parameters
    ----------
    found : sequence of Pocket
        Pockets of a diagram.
    count : int
        Largest number of pockets returned.
    by : {"depth", "removal"}
        Depth, or depth times speed (chip volume at one feed per tooth).

    Returns
    -------
    list of Pocket
        Best pockets.

    Raises
    ------
    ValueError
        For any other `by`.

    Examples
    --------
    >>> few = [Pocket(5000.0, 3e-3, 4900.0, 5100.0), Pocket(15000.0, 2e-3, 14500.0, 15500.0)]
    >>> rank_pockets(few, 1)[0].speed_rpm, rank_pockets(few, 1, by="removal")[0].speed_rpm  # rpm
    (5000.0, 15000.0)
    """
    if by not in ("depth", "removal"):
        raise ValueError(f'by={by!r} is neither "depth" nor "removal"')
    return sorted(found, key=lambda p: p.depth * (p.speed_rpm if by == "removal" else 1.0), reverse=True)[:count]


def match_pockets(then: StabilityLobes, now: StabilityLobes, deepest: float) -> list[PocketShift]:
    """Match the pockets of two diagrams of one cut: a pair is nearest to each other.

    Pocket k is at about 60 f / (N k): all move by one ratio, that of the median chatter frequencies.
    Pockets at an end of the speed range are left out, as their deepest points lie outside.

    Parameters
    ----------
    then, now : StabilityLobes
        Diagrams before and after.
    deepest : float
        Deepest cut of interest (m).

    Returns
    -------
    list of PocketShift
        Pairs of pockets.

    Examples
    --------
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> new, old = ([Mode(f, damping_ratio=0.02, stiffness=2e7)] for f in (500.0, 450.0))  # 10 % lower
    >>> then, now = (zero_order_lobes(m, m, slot, np.linspace(4000.0, 18000.0, 701)) for m in (new, old))
    >>> [round(shift.speed_change, 2) for shift in match_pockets(then, now, deepest=5e-3)]
    [-0.1, -0.1, -0.1]
    """
    before, after = _pockets_inside(then, deepest), _pockets_inside(now, deepest)
    if not before or not after:
        return []
    ratio = _median_chatter_frequency(now) / _median_chatter_frequency(then)
    speeds: Floats = np.log([pocket.speed_rpm for pocket in after])
    shifts = []
    for pocket in before:
        expected = np.log(pocket.speed_rpm * ratio)
        nearest = int(np.argmin(np.abs(speeds - expected)))
        back = int(np.argmin([abs(np.log(p.speed_rpm * ratio) - speeds[nearest]) for p in before]))
        if before[back] == pocket:
            shifts.append(PocketShift(pocket, after[nearest]))
    return shifts


def _pockets_inside(lobes: StabilityLobes, deepest: float) -> list[Pocket]:
    ends = (np.min(lobes.speed_rpm), np.max(lobes.speed_rpm))
    return [pocket for pocket in find_pockets(lobes, deepest) if pocket.speed_rpm not in ends]


def _median_chatter_frequency(lobes: StabilityLobes) -> float:
    frequency = lobes.chatter_frequency[np.isfinite(lobes.chatter_frequency)]
    return float(np.median(frequency)) if frequency.size else 1.0
