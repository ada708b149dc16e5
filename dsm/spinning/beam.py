"""A spinning beam that need not be round, as plain data in the frame that turns with it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

Dof = Literal["u", "v", "u'", "v'"]
"""Deflections along the axes x and y of the section, and their slopes du/dz and dv/dz."""


@dataclass(frozen=True)
class SpinningSegment:
    """A uniform piece of the beam, its principal axes x and y along those of all others."""

    length: float
    """Length along the beam (m)."""
    rigidity_xx: float
    """Bending stiffness EIxx about the x axis, against deflection v along y (N m^2)."""
    rigidity_yy: float
    """Bending stiffness EIyy about the y axis, against deflection u along x (N m^2)."""
    mass_per_length: float
    """Mass per length (kg/m)."""


@dataclass(frozen=True)
class SpinningSpring:
    """A spring to the axis of spin that turns with the beam; with equal stiffnesses it may as well stand still."""

    position: float
    """Distance from the first end (m)."""
    stiffness_x: float
    """Stiffness against u (N/m); 0 where there is none."""
    stiffness_y: float | None = None
    """Stiffness against v (N/m); None: the same."""


@dataclass(frozen=True)
class SpinningBeam:
    """Segments in a row from z = 0 on, springs, and dofs that are held; free where nothing is said.

    Raises ValueError, naming the segment or spring (1 is the first), for numbers out of range or places off the beam.

    >>> clamp = [(0.0, dof) for dof in ("u", "v", "u'", "v'")]
    >>> cantilever = SpinningBeam([SpinningSegment(0.5, 1e4, 1e4, 15.0)], held=clamp)
    >>> spinning_frequencies(cantilever, 1, 0.0).round(2).tolist()  # Hz
    [57.79]
    >>> round(1.87510407**2 / (2 * np.pi * 0.5**2) * (1e4 / 15.0) ** 0.5, 2)  # cos x cosh x = -1
    57.79
    """

    segments: Sequence[SpinningSegment]
    """Segments in order; kept as a tuple."""
    springs: Sequence[SpinningSpring] = ()
    """Springs in any order; those at one place add up; kept as a tuple."""
    held: Sequence[tuple[float, Dof]] = ()
    """Position (m) and name of each dof that is held: "u" and "v" are a pin, all four a clamp; kept as a tuple."""

    def __post_init__(self) -> None:
        """Check numbers and geometry."""
        for name in ("segments", "springs", "held"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.segments:
            raise ValueError("a beam without segments was given; at least one is needed")
        for number, segment in enumerate(self.segments, 1):
            for name in ("length", "rigidity_xx", "rigidity_yy", "mass_per_length"):
                check_positive(f"segment {number}: {name}", getattr(segment, name))
        for number, spring in enumerate(self.springs, 1):
            self._check_spring(f"spring {number}: ", spring)
        for position, dof in self.held:
            self._check_place("held: ", position)
            if dof not in get_args(Dof):
                raise ValueError(f"held: dof={dof!r} is none of {', '.join(get_args(Dof))}")

    @property
    def length(self) -> float:
        """Length of the beam (m)."""
        return math.fsum(segment.length for segment in self.segments)

    @property
    def is_round(self) -> bool:
        """True where x and y are alike: any two perpendicular axes would do."""
        return (
            all(segment.rigidity_xx == segment.rigidity_yy for segment in self.segments)
            and all(spring.stiffness_y in (None, spring.stiffness_x) for spring in self.springs)
            and self._supports("u") == self._supports("v")
        )

    @property
    def is_supported(self) -> bool:
        """True where nothing moves without bending or straining a spring, in either plane."""
        for axis in ("u", "v"):
            supports = self._supports(axis)
            pins = {position for position, is_slope in supports if not is_slope}
            if len(pins) < 2 and not (pins and len(supports) > len(pins)):
                return False
        return True

    def stiffness(self, spring: SpinningSpring) -> Iterator[tuple[Dof, float]]:
        """What a spring adds to u and to v (N/m)."""
        yield "u", spring.stiffness_x
        yield "v", spring.stiffness_x if spring.stiffness_y is None else spring.stiffness_y

    def _supports(self, axis: str) -> set[tuple[float, bool]]:
        """Where u or v is held or sprung (False) and where its slope is held (True)."""
        held = {(position, dof.endswith("'")) for position, dof in self.held if dof[0] == axis}
        sprung = (s.position for s in self.springs for dof, k in self.stiffness(s) if dof == axis and k > 0)
        return held | {(position, False) for position in sprung}

    def _check_spring(self, where: str, spring: SpinningSpring) -> None:
        self._check_place(where, spring.position)
        for dof, value in self.stiffness(spring):
            if not (math.isfinite(value) and value >= 0):
                axis = {"u": "x", "v": "y"}[dof]
                raise ValueError(f"{where}stiffness_{axis}={value} is not a finite number >= 0; hold the dof instead")

    def _check_place(self, where: str, position: float) -> None:
        if not 0 <= position <= self.length * (1 + 1e-9):
            raise ValueError(f"{where}position={position} m is off the beam, 0 to {self.length:g} m")


def check_positive(name: str, value: float) -> None:
    """Raise ValueError for what is no finite number > 0."""
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name}={value} is not a finite number > 0")
