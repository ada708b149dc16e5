"""The result of every stability method."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition import Remark
from lobes.speeds import check_speeds

MethodName = Literal["average angle", "zero order", "semi-discretisation"]
"""How stability limits are found."""


@dataclass(frozen=True, eq=False)
class Lobe:
    """One unbroken piece of one lobe, in the order of rising chatter frequency, for drawing."""

    number: int
    """Whole waves left on the surface between two teeth, j = 0, 1, 2 ..."""
    speed_rpm: NDArray[np.float64]
    """Spindle speed (rpm), shape (p,); it need not rise."""
    depth: NDArray[np.float64]
    """Limiting depth (m), shape (p,)."""
    chatter_frequency: NDArray[np.float64]
    """Chatter frequency (Hz), shape (p,)."""


class Minimum(NamedTuple):
    """The lowest point of a stability chart."""

    depth: float
    """Limiting depth (m); inf where no speed of the chart has a limit."""
    speed_rpm: float
    """Speed (rpm)."""
    chatter_frequency: float
    """Chatter frequency (Hz); nan where the depth is inf."""


@dataclass(frozen=True, eq=False)
class StabilityLobes:
    """Limiting axial depth of cut over spindle speed.

    Raises ValueError where shapes differ, a speed or a depth is not > 0, or a depth is NaN.

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = zero_order([mode], [mode], slot, np.linspace(4000.0, 18000.0, 701))
    >>> (lobes.depth_at([9000.0, 15000.0]) * 1e3).round(3).tolist()  # mm
    [1.278, 18.766]
    >>> lobes.is_stable([9000.0, 15000.0], 0.5e-3).tolist()
    [True, True]
    """

    speed_rpm: NDArray[np.float64]
    """Spindle speeds (rpm), as they were asked for, shape (n,)."""
    depth: NDArray[np.float64]
    """Limiting depth at each speed, the lowest crossing (m), shape (n,); inf where stable at any depth."""
    chatter_frequency: NDArray[np.float64]
    """Chatter frequency at the limit (Hz), shape (n,); nan where the depth is inf."""
    kind: NDArray[np.str_]
    """"hopf" (quasi-periodic chatter), "flip" (period two) or "" (no limit), shape (n,)."""
    crossings: NDArray[np.float64]
    """Depths where stability changes, rising in each row and filled up with inf (m), shape (n, k)."""
    method: MethodName
    """Method that the limits were found by."""
    curves: Callable[[], Iterable[Lobe]] = tuple
    """Function that works out `lobes`."""
    remarks: tuple[Remark, ...] = ()
    """Reasons why the method or the FRF is out of its range for this cut, and what to do."""
    detail: str = ""
    """Detail of the method: into how many pieces the tooth period was divided."""

    def __post_init__(self) -> None:
        """Check shapes and values."""
        object.__setattr__(self, "speed_rpm", check_speeds(self.speed_rpm))
        n = self.speed_rpm.size
        for name in ("depth", "chatter_frequency", "kind"):
            if np.shape(getattr(self, name)) != (n,):
                raise ValueError(
                    f"{name} has shape {np.shape(getattr(self, name))}, speed_rpm ({n},); give one a speed"
                )
        if self.crossings.ndim != 2 or len(self.crossings) != n:
            raise ValueError(f"crossings has shape {self.crossings.shape}; one row for each of {n} speeds is needed")
        bad = np.flatnonzero(~(self.depth > 0))
        if bad.size:
            raise ValueError(
                f"depth[{bad[0]}]={self.depth[bad[0]]} m is not > 0; give inf where a cut is stable at any depth"
            )

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Lobes that set the limit at one speed at least, as far as the speeds reach; empty where a method has none.

        Worked out each time they are asked for."""
        return tuple(self.curves())

    @property
    def stated_method(self) -> str:
        """The method with its detail, for people."""
        return ", ".join(filter(None, (self.method, self.detail)))

    @property
    def minimum(self) -> Minimum:
        """The lowest limit among the speeds of this chart; the first of them where none has a limit."""
        i = int(np.argmin(self.depth))
        return Minimum(float(self.depth[i]), float(self.speed_rpm[i]), float(self.chatter_frequency[i]))

    def depth_at(self, speed_rpm: ArrayLike) -> NDArray[np.float64]:
        """Limiting depth at one or several speeds inside the range (m), shape of speed_rpm.

        Linear between the speeds of the chart; beside a speed without limit the finite neighbour counts.
        Raises ValueError outside the range.
        """
        wanted = np.asarray(speed_rpm, dtype=np.float64)
        low, high = float(np.min(self.speed_rpm)), float(np.max(self.speed_rpm))
        outside = ~((wanted >= low) & (wanted <= high))
        if np.any(outside):
            raise ValueError(
                f"{wanted[outside].flat[0]:g} rpm is outside the chart ({low:g}..{high:g} rpm); compute lobes there too"
            )
        order = np.argsort(self.speed_rpm)
        speed, depth = self.speed_rpm[order], self.depth[order]
        right = np.searchsorted(speed, wanted)
        left = np.where(speed[right] == wanted, right, right - 1)
        below, above = depth[left], depth[right]
        share = (wanted - speed[left]) / np.where(right == left, 1.0, speed[right] - speed[left])
        with np.errstate(invalid="ignore"):
            between = below + share * (above - below)
        return np.where(np.isfinite(between), between, np.minimum(below, above))

    def is_stable(self, speed_rpm: ArrayLike, depth: ArrayLike) -> NDArray[np.bool_]:
        """Whether cuts of this depth (m) at this speed (rpm) lie below the limit; shapes broadcast."""
        wanted = np.asarray(depth, dtype=np.float64)
        if not np.all(wanted >= 0):
            raise ValueError(f"depth={wanted} m is not >= 0; give the axial depth of cut in metres")
        return np.asarray(wanted < self.depth_at(speed_rpm))
