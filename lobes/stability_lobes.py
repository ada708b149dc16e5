"""Result of every stability method: limits over speed and over radial depth."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition import Remark
from lobes.cut import Cut
from modal.arrays import Flags, Floats


def check_vector(name: str, values: ArrayLike, item: str, text: str = "", may_be_zero: bool = False) -> Floats:
    """Return values as a 1-D array; ValueError unless there is one at least.

    With a text all must be finite and > 0, or 0 where that is allowed.
    """
    vector = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if vector.ndim != 1 or vector.size == 0:
        raise ValueError(f"{name} has shape {vector.shape}. Give a 1-D array of at least one {item}.")
    bad = np.flatnonzero(~(np.isfinite(vector) & ((vector >= 0) if may_be_zero else (vector > 0))))
    if text and bad.size:
        raise ValueError(f"{name}[{bad[0]}]={vector[bad[0]]} {text}")
    return vector


def check_speeds(speed_rpm: ArrayLike) -> Floats:
    """Return spindle speeds (rpm) as a 1-D array; ValueError unless there is one and all are finite and > 0."""
    text = "is not a finite speed > 0 rpm. Leave this speed out."
    return check_vector("speed_rpm", speed_rpm, "speed (rpm)", text)


MethodName = Literal["average angle", "zero order", "semi-discretisation"]
"""Name of a stability method."""


@dataclass(frozen=True, eq=False)
class Lobe:
    """Unbroken piece of one lobe for drawing, in the order of rising chatter frequency."""

    number: int
    """Number of whole waves between two teeth, j = 0, 1, 2 ..."""
    speed_rpm: Floats
    """Spindle speed (rpm), shape (p,); not always rising."""
    depth: Floats
    """Limiting depth (m), shape (p,)."""
    chatter_frequency: Floats
    """Chatter frequency (Hz), shape (p,)."""


class LobeMinimum(NamedTuple):
    """Lowest point of a stability chart."""

    depth: float
    """Limiting depth (m); inf if no speed has a limit."""
    speed_rpm: float
    """Speed (rpm)."""
    chatter_frequency: float
    """Chatter frequency (Hz); nan if the depth is inf."""


@dataclass(frozen=True, eq=False)
class StabilityLobes:
    """Limiting axial depth of cut over spindle speed.

    Raises
    ------
    ValueError
        If shapes differ, a speed or a depth is not > 0, or a depth is NaN.

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = zero_order_lobes([mode], [mode], slot, np.linspace(4000.0, 18000.0, 701))
    >>> (lobes.depth_at([9000.0, 15000.0]) * 1e3).round(3).tolist()  # mm
    [1.278, 18.766]
    >>> lobes.is_stable([9000.0, 15000.0], 0.5e-3).tolist()
    [True, True]
    """

    speed_rpm: Floats
    """Spindle speeds (rpm) in the given order, shape (n,)."""
    depth: Floats
    """Limiting depth at each speed, the lowest crossing (m), shape (n,); inf if stable at any depth."""
    chatter_frequency: Floats
    """Chatter frequency at the limit (Hz), shape (n,); nan if the depth is inf."""
    kind: NDArray[np.str_]
    """"hopf" (quasi-periodic chatter), "flip" (period two) or "" (no limit), shape (n,)."""
    crossings: Floats
    """Depths where stability changes, rising in each row and padded with inf (m), shape (n, k)."""
    method: MethodName
    """Method of the limits."""
    curves: Callable[[], Iterable[Lobe]] = tuple
    """Function that computes `lobes`."""
    remarks: tuple[Remark, ...] = ()
    """Reasons why the method or the FRF is out of its range for this cut, and remedies."""
    detail: str = ""
    """Detail of the method: number of pieces of the tooth period."""

    def __post_init__(self) -> None:
        """Check shapes and values."""
        object.__setattr__(self, "speed_rpm", check_speeds(self.speed_rpm))
        n = self.speed_rpm.size
        for name in ("depth", "chatter_frequency", "kind"):
            shape = np.shape(getattr(self, name))
            if shape != (n,):
                raise ValueError(f"{name} has shape {shape}, speed_rpm ({n},). Give one value per speed.")
        if self.crossings.ndim != 2 or len(self.crossings) != n:
            raise ValueError(f"crossings has shape {self.crossings.shape}. Give one row for each of {n} speeds.")
        bad = np.flatnonzero(~(self.depth > 0))
        if bad.size:
            wrong = f"depth[{bad[0]}]={self.depth[bad[0]]} m"
            raise ValueError(f"{wrong} is not > 0. Give inf for a cut that is stable at any depth.")

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Lobes that set the limit at one speed at least, within the speeds; empty for methods without lobes.

        Computed at each access.
        """
        return tuple(self.curves())

    @property
    def method_text(self) -> str:
        """Method with its detail."""
        return ", ".join(filter(None, (self.method, self.detail)))

    @property
    def minimum(self) -> LobeMinimum:
        """Lowest limit of this chart; the first speed if there is no limit."""
        i = int(np.argmin(self.depth))
        return LobeMinimum(float(self.depth[i]), float(self.speed_rpm[i]), float(self.chatter_frequency[i]))

    def depth_at(self, speed_rpm: ArrayLike) -> Floats:
        """Return the limiting depth at speeds inside the range, linear between the speeds of the chart.

        Next to a speed without limit the finite neighbour counts.

        Parameters
        ----------
        speed_rpm : array_like
            Spindle speeds (rpm), any shape.

        Returns
        -------
        ndarray
            Limiting depths (m), same shape.

        Raises
        ------
        ValueError
            For a speed outside the chart.
        """
        wanted = np.asarray(speed_rpm, dtype=np.float64)
        low, high = float(np.min(self.speed_rpm)), float(np.max(self.speed_rpm))
        outside = ~((wanted >= low) & (wanted <= high))
        if np.any(outside):
            chart = f"the chart ({low:g}..{high:g} rpm)"
            raise ValueError(f"{wanted[outside].flat[0]:g} rpm is outside {chart}. Compute the lobes at this speed.")
        order = np.argsort(self.speed_rpm)
        speed, depth = self.speed_rpm[order], self.depth[order]
        right = np.searchsorted(speed, wanted)
        left = np.where(speed[right] == wanted, right, right - 1)
        below, above = depth[left], depth[right]
        share = (wanted - speed[left]) / np.where(right == left, 1.0, speed[right] - speed[left])
        with np.errstate(invalid="ignore"):
            between = below + share * (above - below)
        return np.where(np.isfinite(between), between, np.minimum(below, above))

    def is_stable(self, speed_rpm: ArrayLike, depth: ArrayLike) -> Flags:
        """Return whether cuts are below the limit; shapes broadcast.

        Parameters
        ----------
        speed_rpm : array_like
            Spindle speeds (rpm).
        depth : array_like
            Axial depths of cut (m).

        Returns
        -------
        ndarray of bool
            True below the limit.

        Raises
        ------
        ValueError
            For a speed outside the chart or a negative depth.
        """
        wanted = np.asarray(depth, dtype=np.float64)
        if not np.all(wanted >= 0):
            raise ValueError(f"depth={wanted} m is not >= 0. Give the axial depth ap in metres.")
        return np.asarray(wanted < self.depth_at(speed_rpm))


def lower_envelope(diagrams: Sequence[StabilityLobes]) -> StabilityLobes:
    """Join several diagrams by one method at the same speeds: at each speed the lowest limit counts.

    For example the feed directions of one cut. All lobes and remarks are kept, each remark once.

    Parameters
    ----------
    diagrams : sequence of StabilityLobes
        Diagrams of one cut.

    Returns
    -------
    StabilityLobes
        Limits that hold for all of them.

    Examples
    --------
    >>> x, y = Mode(500.0, 0.02, 2e7), Mode(700.0, 0.02, 2e7)
    >>> along_x = Cut(teeth=2, immersion=0.5, direction="up", tangential=700e6, radial=200e6)
    >>> speeds = [9000.0, 12000.0, 15000.0]
    >>> fed = [zero_order_lobes([x], [y], along_x, speeds), zero_order_lobes([y], [x], along_x, speeds)]
    >>> [(lobes.depth * 1e3).round(2).tolist() for lobes in (*fed, lower_envelope(fed))]  # mm
    [[4.3, 12.54, 8.37], [18.35, 5.59, 22.18], [4.3, 5.59, 8.37]]
    """
    first = diagrams[0]
    lowest, speed = np.argmin([diagram.depth for diagram in diagrams], axis=0), np.arange(first.speed_rpm.size)
    crossings = pad_columns([diagram.crossings for diagram in diagrams])
    columns = ("depth", "chatter_frequency", "kind")
    return replace(
        first,
        **{name: np.stack([getattr(diagram, name) for diagram in diagrams])[lowest, speed] for name in columns},
        crossings=np.stack(crossings)[lowest, speed],
        curves=partial(_lobes_of_all, diagrams),
        remarks=tuple(dict.fromkeys(remark for diagram in diagrams for remark in diagram.remarks)),
    )


def _lobes_of_all(diagrams: Sequence[StabilityLobes]) -> list[Lobe]:
    return [lobe for diagram in diagrams for lobe in diagram.lobes]


def pad_columns(tables: Sequence[Floats]) -> list[Floats]:
    """Pad tables with inf to the same number of columns."""
    width = max(table.shape[1] for table in tables)
    return [np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=np.inf) for table in tables]


@dataclass(frozen=True, eq=False)
class RadialLobes:
    """Limiting axial depth over spindle speed and radial depth."""

    speed_rpm: Floats
    """Spindle speeds (rpm), shape (n,)."""
    immersion: Floats
    """Radial depths over cutter diameter, shape (r,)."""
    depth: Floats
    """Limiting depths (m), shape (r, n); inf if there is no limit."""
    method: MethodName
    """Method of the limits."""
    remarks: tuple[Remark, ...]
    """Remarks on the method at the smallest immersion."""


def radial_lobes(limits: Callable[[Cut], StabilityLobes], cut: Cut, immersion: ArrayLike) -> RadialLobes:
    """Compute the limits of a cut at several immersions, by any method.

        radial_lobes(lambda cut: stability_boundary(x, y, cut, speeds, 0.02), cut, np.linspace(0.05, 1, 20))

    Parameters
    ----------
    limits : callable
        Function from a cut to its StabilityLobes.
    cut : Cut
        Cut whose immersion is varied.
    immersion : array_like, shape (r,)
        Radial depths over cutter diameter (-), in (0, 1].

    Returns
    -------
    RadialLobes
        Limits at all immersions.

    Raises
    ------
    ValueError
        For immersions outside (0, 1].

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> chart = radial_lobes(lambda cut: zero_order_lobes([mode], [mode], cut, [9000.0]), slot, [0.25, 0.5, 1.0])
    >>> (chart.depth * 1e3).round(2).tolist()  # mm, by radial depth
    [[6.76], [3.29], [1.28]]
    """
    shares = check_vector("immersion", immersion, "value in (0, 1]")
    charts = [limits(replace(cut, immersion=float(share))) for share in shares]
    depth, remarks = np.stack([chart.depth for chart in charts]), charts[int(np.argmin(shares))].remarks
    return RadialLobes(charts[0].speed_rpm, shares, depth, charts[0].method, remarks)
