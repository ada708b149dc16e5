"""The spindle as plain data, and the same spindle with another tool."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Literal, TypeVar, get_args

import numpy as np

from dsm.spindle.attachments import Bearing, Joint, LumpedMass
from dsm.spindle.segment import SAME_PLACE, STEEL, Material, Segment, nearest_index, ring_area

Theory = Literal["euler-bernoulli", "timoshenko"]
"""Beam theory; "timoshenko" adds shear, rotary inertia and gyroscopic moments."""

MAX_SEGMENTS = 500
"""Most segments: the work grows with their third power."""


@dataclass(frozen=True)
class Spindle:
    """Spindle with holder and tool, segment after segment from the tool tip (z = 0) on.

    Raises
    ------
    ValueError
        For an invalid shaft or part; the message names the part (1 is the first of its kind).

    Examples
    --------
    >>> spindle = Spindle(
    ...     segments=[Segment(0.1, 0.02), Segment(0.3, 0.06, bore_diameter=0.02)],
    ...     bearings=[Bearing(0.15, 2e8), Bearing(0.35, 1e8)],
    ... )
    >>> f"{spindle.length:.1f} m, {spindle.mass:.2f} kg"
    '0.4 m, 6.17 kg'
    >>> Spindle([Segment(0.1, 0.02)], [Bearing(0.15, 2e8)])
    Traceback (most recent call last):
        ...
    ValueError: bearing 1: position=0.15 m is not on the shaft (0 to 0.1 m)
    """

    segments: Sequence[Segment]
    """Segments from the tool tip on; kept as a tuple."""
    bearings: Sequence[Bearing]
    """Bearings in any order; kept as a tuple. Without bearings the shaft is free."""
    youngs_modulus: float = STEEL.youngs_modulus
    """Young's modulus E (Pa) of segments without a material."""
    density: float = STEEL.density
    """Density rho (kg/m^3) of segments without a material."""
    theory: Theory = "euler-bernoulli"
    """Beam theory; "timoshenko" adds shear, rotary inertia and gyroscopic moments of the shaft."""
    shear_modulus: float | None = None
    """Shear modulus G (Pa) of segments without a material. Default: E/(2 + 2 nu), for Poisson's ratio nu = 0.3."""
    masses: Sequence[LumpedMass] = ()
    """Rigid bodies on the shaft; kept as a tuple."""
    joints: Sequence[Joint] = ()
    """Compliant joints across the shaft; kept as a tuple."""
    axial_poisson_ratio: float | None = None
    """Poisson's ratio nu of an orthotropic shaft pulled along its axis (-). Default: isotropic."""

    def __post_init__(self) -> None:
        """Check numbers and geometry."""
        for name in ("segments", "bearings", "masses", "joints"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.theory not in get_args(Theory):
            raise ValueError(f"theory={self.theory!r} is not one of {', '.join(get_args(Theory))}")
        if not 1 <= len(self.segments) <= MAX_SEGMENTS:
            raise ValueError(f"the shaft has {len(self.segments)} segments. Give 1 to {MAX_SEGMENTS} segments.")
        _ = self.material  # checks its constants
        for number, segment in enumerate(self.segments, 1):
            segment.check(f"segment {number}: ")
        for kind, parts in (("bearing", self.bearings), ("mass", self.masses), ("joint", self.joints)):
            self._check_parts(kind, parts)
        self._check_joints()

    def __hash__(self) -> int:
        """Return a cached hash, as matrices are cached by their spindle."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(tuple(getattr(self, field.name) for field in fields(self)))

    @cached_property
    def material(self) -> Material:
        """Material of segments without a material."""
        ratio, shear = self.axial_poisson_ratio, self.shear_modulus
        if shear is None:
            shear = self.youngs_modulus / (2 * (1 + (0.3 if ratio is None else ratio)))
        return Material(self.youngs_modulus, self.density, shear, ratio)

    @cached_property
    def length(self) -> float:
        """Length of the shaft (m)."""
        return math.fsum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass of the shaft and of the rigid bodies (kg)."""
        return math.fsum([*map(self._segment_mass, self.segments), *(part.mass for part in self.masses)])

    def _segment_mass(self, segment: Segment) -> float:
        """Compute the mass by Simpson's rule, exact for a cone."""
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
                raise ValueError(f"{where}position={part.position} m is not on the shaft (0 to {length:g} m)")
            part.check(where)
            for earlier, other in enumerate(parts[: number - 1], 1):
                if abs(other.position - part.position) <= slack:
                    same = f"the position of {kind} {earlier}. Combine the two into one {kind}."
                    raise ValueError(f"{where}position={part.position} m is {same}")

    def _check_joints(self) -> None:
        """Check that a joint is inside the shaft and alone at its place, as the side of a part would be unknown."""
        slack = SAME_PLACE * self.length
        others: list[tuple[str, Sequence[Bearing | LumpedMass]]] = [("bearing", self.bearings), ("mass", self.masses)]
        for number, joint in enumerate(self.joints, 1):
            where = f"joint {number}: position={joint.position} m is "
            if not slack < joint.position < self.length - slack:
                raise ValueError(f"{where}an end of the shaft. Place the joint between two segments.")
            for kind, parts in others:
                for other, part in enumerate(parts, 1):
                    if abs(part.position - joint.position) <= slack:
                        raise ValueError(
                            f"{where}the position of {kind} {other}. Move the {kind} to its own side of the joint."
                        )


def require_support(spindle: Spindle) -> None:
    """Raise ValueError unless the shaft is supported by two bearings, or by one that resists tilting."""
    tilting = any(bearing.rotational_stiffness > 0 for bearing in spindle.bearings)
    if len(spindle.bearings) + tilting < 2:
        raise ValueError(
            f"the shaft has {len(spindle.bearings)} bearing(s) and can move freely. Give at least two bearings, or one "
            "with a rotational stiffness."
        )


Part = TypeVar("Part", Bearing, LumpedMass, Joint)


def cut_spindle(spindle: Spindle, position: float) -> tuple[Spindle, Joint | None]:
    """Return the spindle beyond `position` from the tool tip (m), with positions from the cut, and the joint there.

    A segment at the cut is divided. Bearings, masses and joints nearer to the tool tip are removed; a bearing or a mass
    at the cut stays. Raises ValueError for a cut off the shaft or at its far end.
    """
    slack = SAME_PLACE * spindle.length
    if not 0 <= position < spindle.length - slack:
        raise ValueError(f"position={position} m leaves no spindle. Cut it between 0 and {spindle.length:g} m.")
    ends = np.cumsum([0.0, *(segment.length for segment in spindle.segments)])
    end = float(ends[nearest_index(ends, position)])
    cut = end if abs(end - position) <= slack else float(position)
    at_cut = [joint for joint in spindle.joints if abs(joint.position - cut) <= slack]
    rest = replace(
        spindle,
        segments=[
            _rest_of_segment(segment, max(cut - start, 0.0))
            for segment, start, end in zip(spindle.segments, ends[:-1], ends[1:], strict=True)
            if end > cut
        ],
        bearings=shift_parts([part for part in spindle.bearings if part.position >= cut - slack], -cut),
        masses=shift_parts([part for part in spindle.masses if part.position >= cut - slack], -cut),
        joints=shift_parts([part for part in spindle.joints if part.position > cut + slack], -cut),
    )
    return rest, at_cut[0] if at_cut else None


def shift_parts(parts: Iterable[Part], shift: float) -> list[Part]:
    """Return the parts moved away from the tool tip by `shift` (m); none before it."""
    return [replace(part, position=max(part.position + shift, 0.0)) for part in parts]


def _rest_of_segment(segment: Segment, removed: float) -> Segment:
    """Return a segment without its first part of length `removed` (m)."""
    outer, bore = segment.diameters_at(removed / segment.length)
    return replace(segment, length=segment.length - removed, outer_diameter=outer, bore_diameter=bore)


def change_tool(spindle: Spindle, position: float, tool: Spindle) -> Spindle:
    """Replace the tool of a spindle.

    A bearing, a mass or a joint at the cut stays with the spindle; everything nearer to the old tip is removed.
    Segments
    of the tool without a material keep that of the tool.

    Parameters
    ----------
    spindle : Spindle
        Spindle with the old tool.
    position : float
        Distance of the cut from the old tool tip (m).
    tool : Spindle
        New tool as a free shaft: its first segment is the tip, its last one is fixed to the spindle.

    Returns
    -------
    Spindle
        Spindle with the new tool.

    Raises
    ------
    ValueError
        For a cut off the shaft, a tool with bearings, and one of another beam theory.

    Examples
    --------
    >>> long_tool = Spindle([Segment(0.1, 0.02), Segment(0.3, 0.05)], [Bearing(0.15, 2e8), Bearing(0.38, 2e8)])
    >>> short_tool = change_tool(long_tool, 0.1, Spindle([Segment(0.06, 0.02)], []))
    >>> round(short_tool.length, 2), [round(bearing.position, 2) for bearing in short_tool.bearings]  # m
    (0.36, [0.11, 0.34])
    """
    check_tool(tool, spindle.theory)
    rest, joint = cut_spindle(spindle, position)
    between = [] if joint is None else [replace(joint, position=tool.length)]
    segments = list(tool.segments)
    if tool.material != spindle.material:
        segments = [replace(segment, material=segment.material or tool.material) for segment in segments]
    return replace(
        rest,
        segments=[*segments, *rest.segments],
        bearings=shift_parts(rest.bearings, tool.length),
        masses=[*tool.masses, *shift_parts(rest.masses, tool.length)],
        joints=[*tool.joints, *between, *shift_parts(rest.joints, tool.length)],
    )


def check_tool(tool: Spindle, theory: str) -> None:
    """Raise ValueError for a tool that does not fit into a spindle of a beam theory."""
    if tool.bearings:
        raise ValueError(f"the tool has {len(tool.bearings)} bearing(s). Give a free shaft, without bearings.")
    if tool.theory != theory:
        raise ValueError(f"the tool has theory={tool.theory!r}, the spindle {theory!r}. Use the same theory for both.")
