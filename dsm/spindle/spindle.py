"""The spindle as plain data: round segments, bearings, masses and joints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Literal, get_args

from dsm.spindle.attachments import Bearing, Joint, LumpedMass
from dsm.spindle.checks import require_positive
from dsm.spindle.material import STEEL, Material
from dsm.spindle.places import SAME_PLACE
from dsm.spindle.segment import Segment, ring_area

Theory = Literal["euler-bernoulli", "timoshenko"]
"""Beam theory; "timoshenko" adds shear, rotary inertia and gyroscopic moments."""

MAX_SEGMENTS = 500
"""More are refused: the work grows with their third power."""


@dataclass(frozen=True)
class Spindle:
    """A spindle with holder and tool, segment after segment from the tool tip (z = 0) on.

    Raises ValueError, naming the part (1 is the first of its kind), for what is no shaft or does not fit it.

    >>> spindle = Spindle(
    ...     segments=[Segment(0.1, 0.02), Segment(0.3, 0.06, bore_diameter=0.02)],
    ...     bearings=[Bearing(0.15, 2e8), Bearing(0.35, 1e8)],
    ... )
    >>> f"{spindle.length:.1f} m, {spindle.mass:.2f} kg"
    '0.4 m, 6.17 kg'
    >>> Spindle([Segment(0.1, 0.02)], [Bearing(0.15, 2e8)])
    Traceback (most recent call last):
        ...
    ValueError: bearing 1: position=0.15 m is off the shaft, 0 to 0.1 m
    """

    segments: Sequence[Segment]
    """Segments in order from the tool tip; kept as a tuple."""
    bearings: Sequence[Bearing]
    """Bearings in any order, at segment ends or between them; kept as a tuple. None: a free shaft."""
    youngs_modulus: float = STEEL.youngs_modulus
    """Young's modulus E (Pa) of segments without a material of their own."""
    density: float = STEEL.density
    """Density rho (kg/m^3) of the same."""
    theory: Theory = "euler-bernoulli"
    """Beam theory; "timoshenko" adds shear, rotary inertia and gyroscopic moments of the shaft."""
    shear_modulus: float | None = None
    """Shear modulus G (Pa) of segments without a material of their own; None: E/2.6, of Poisson's ratio 0.3."""
    masses: Sequence[LumpedMass] = ()
    """Rigid bodies on the shaft; kept as a tuple."""
    joints: Sequence[Joint] = ()
    """Compliant joints across the shaft; kept as a tuple."""

    def __post_init__(self) -> None:
        """Check numbers and geometry."""
        for name in ("segments", "bearings", "masses", "joints"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.theory not in get_args(Theory):
            raise ValueError(f"theory={self.theory!r} is none of {', '.join(get_args(Theory))}")
        if not 1 <= len(self.segments) <= MAX_SEGMENTS:
            raise ValueError(f"{len(self.segments)} segments were given; a spindle has 1 to {MAX_SEGMENTS} of them")
        require_positive("", "youngs_modulus", self.youngs_modulus, "Pa")
        require_positive("", "density", self.density, "kg/m^3")
        if self.shear_modulus is not None:
            require_positive("", "shear_modulus", self.shear_modulus, "Pa")
        for number, segment in enumerate(self.segments, 1):
            segment.check(f"segment {number}: ")
        self._check_parts("bearing", self.bearings)
        self._check_parts("mass", self.masses)
        self._check_parts("joint", self.joints)
        self._check_joints()

    def __hash__(self) -> int:
        """Worked out once: matrices are kept by their spindle."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, field.name) for field in fields(self)))

    @cached_property
    def material(self) -> Material:
        """Material of segments without one of their own."""
        shear = self.youngs_modulus / 2.6 if self.shear_modulus is None else self.shear_modulus
        return Material(self.youngs_modulus, self.density, shear)

    @cached_property
    def length(self) -> float:
        """Length of the shaft (m)."""
        return math.fsum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass of the shaft with all that sits on it (kg)."""
        return math.fsum([*map(self._segment_mass, self.segments), *(part.mass for part in self.masses)])

    def _segment_mass(self, segment: Segment) -> float:
        """Volume by Simpson's rule, exact for a cone."""
        ends = [segment.diameters_at(share) for share in (0.0, 0.5, 1.0)]
        areas = [ring_area(segment.mass_diameter or outer, bore) for outer, bore in ends]
        density = segment.material.density if segment.material else self.density
        return density * segment.length * (areas[0] + 4 * areas[1] + areas[2]) / 6

    def _check_parts(self, kind: str, parts: Sequence[Bearing | LumpedMass | Joint]) -> None:
        length = self.length
        slack = SAME_PLACE * length
        for number, part in enumerate(parts, 1):
            where = f"{kind} {number}: "
            if not -slack <= part.position <= length + slack:
                raise ValueError(f"{where}position={part.position} m is off the shaft, 0 to {length:g} m")
            part.check(where)
            for earlier, other in enumerate(parts[: number - 1], 1):
                if abs(other.position - part.position) <= slack:
                    raise ValueError(
                        f"{where}position={part.position} m is that of {kind} {earlier}; put both into one {kind}"
                    )

    def _check_joints(self) -> None:
        """A joint stands inside the shaft, and nothing else at its place: it would not be known on which side."""
        slack = SAME_PLACE * self.length
        others: list[tuple[str, Sequence[Bearing | LumpedMass]]] = [("bearing", self.bearings), ("mass", self.masses)]
        for number, joint in enumerate(self.joints, 1):
            where = f"joint {number}: position={joint.position} m is "
            if not slack < joint.position < self.length - slack:
                raise ValueError(f"{where}an end of the shaft; nothing is joined there")
            for kind, parts in others:
                for other, part in enumerate(parts, 1):
                    if abs(part.position - joint.position) <= slack:
                        raise ValueError(f"{where}that of {kind} {other}; move the {kind} to the side it belongs to")


def require_support(spindle: Spindle) -> None:
    """Raise ValueError where the shaft can move without bending: it needs two bearings, or one that resists tilting."""
    tilting = any(bearing.rotational_stiffness > 0 for bearing in spindle.bearings)
    if len(spindle.bearings) + tilting < 2:
        raise ValueError(
            f"the shaft is held by {len(spindle.bearings)} bearing(s) and can move freely; at least two are needed, "
            "or one with a rotational stiffness"
        )
