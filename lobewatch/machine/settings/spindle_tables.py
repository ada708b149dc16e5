"""Tables of machine.toml on the spindle model and the tools."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, UnsetType

from acquisition.errors import join_sentences
from dsm import MATERIALS, Bearing, Joint, LumpedMass, Segment, Spindle, Theory
from lobes import ToolMaterial
from lobewatch.machine.settings.cut_tables import ValueRange, convert_pitch
from lobewatch.machine.settings.toml import (
    NotNegative,
    Plausible,
    Positive,
    PositiveOrInfinite,
    TomlTable,
    suggest_spelling,
)

SHAFT_LENGTHS, SHAFT_POSITIONS = Plausible(0.6, 599), Plausible(1, 999)
"""Plausible lengths and diameters of a segment, and positions on the shaft (mm)."""


class SegmentTable(TomlTable, frozen=True):
    """Segment of the shaft."""

    length_mm: Annotated[Positive, SHAFT_LENGTHS]
    outer_mm: Annotated[Positive, SHAFT_LENGTHS]
    bore_mm: Annotated[NotNegative, SHAFT_LENGTHS] = 0.0
    end_outer_mm: Annotated[Positive, SHAFT_LENGTHS] | None = None
    end_bore_mm: Annotated[NotNegative, SHAFT_LENGTHS] | None = None
    mass_outer_mm: Annotated[Positive, SHAFT_LENGTHS] | None = None
    material: str = ""

    def __post_init__(self) -> None:
        _check_wall(self.bore_mm, self.outer_mm, "bore_mm", "outer_mm")
        bore = self.bore_mm if self.end_bore_mm is None else self.end_bore_mm
        _check_wall(bore, self.end_outer_mm or self.outer_mm, "end_bore_mm", "end_outer_mm")
        _check_wall(self.bore_mm, self.mass_outer_mm or math.inf, "bore_mm", "mass_outer_mm")
        if self.material and self.material not in MATERIALS:
            allowed, hint = f"Allowed: {', '.join(MATERIALS)}", suggest_spelling(self.material, MATERIALS)
            raise ValueError(join_sentences(f"unknown material {self.material!r}", allowed, hint))

    def build(self) -> Segment:
        """Build the segment in SI units."""
        return Segment(
            self.length_mm / 1e3,
            self.outer_mm / 1e3,
            self.bore_mm / 1e3,
            material=MATERIALS[self.material] if self.material else None,
            end_outer_diameter=_to_metres(self.end_outer_mm),
            end_bore_diameter=_to_metres(self.end_bore_mm),
            mass_diameter=_to_metres(self.mass_outer_mm),
        )


def _to_metres(millimetres: float | None) -> float | None:
    return None if millimetres is None else millimetres / 1e3


class BearingTable(TomlTable, frozen=True):
    """Bearing of the spindle."""

    position_mm: Annotated[NotNegative, SHAFT_POSITIONS]
    stiffness_n_per_um: Annotated[PositiveOrInfinite, Plausible(5, 4999)] | None = None
    damping_n_s_per_m: Annotated[NotNegative, Plausible(5, 50_000)] = 0.0
    rotational_stiffness_n_m_per_rad: Annotated[NotNegative, Plausible(100, 9e6)] = 0.0
    housing_stiffness_n_per_um: Annotated[PositiveOrInfinite, Plausible(5, 9999)] = math.inf
    group: str = "bearings"
    rolling_elements: Literal["balls", "rollers"] = "balls"

    def build(self, stiffness_n_per_um: float) -> Bearing:
        """Build the bearing in SI units, with a default stiffness."""
        stiffness = stiffness_n_per_um if self.stiffness_n_per_um is None else self.stiffness_n_per_um
        return Bearing(
            self.position_mm / 1e3,
            stiffness * 1e6,
            damping=self.damping_n_s_per_m,
            rotational_stiffness=self.rotational_stiffness_n_m_per_rad,
            housing_stiffness=self.housing_stiffness_n_per_um * 1e6,
            group=self.group,
            rolling_elements=self.rolling_elements,
        )


class MassTable(TomlTable, frozen=True):
    """Lumped mass, for example a pulley or a balance ring."""

    position_mm: Annotated[NotNegative, SHAFT_POSITIONS]
    mass_kg: Annotated[NotNegative, Plausible(0.02, 199)]
    diametral_inertia_kg_mm2: NotNegative = 0.0
    polar_inertia_kg_mm2: NotNegative = 0.0

    def build(self) -> LumpedMass:
        """Build the mass in SI units."""
        inertias = self.diametral_inertia_kg_mm2 / 1e6, self.polar_inertia_kg_mm2 / 1e6
        return LumpedMass(self.position_mm / 1e3, self.mass_kg, *inertias)


class JointTable(TomlTable, frozen=True):
    """Joint: tool in holder, or holder in spindle."""

    position_mm: Annotated[Positive, SHAFT_POSITIONS]
    stiffness_n_per_um: Annotated[Positive, Plausible(20, 1e5)]
    rotational_stiffness_n_m_per_rad: Annotated[Positive, Plausible(1e4, 2e8)]
    group: str = ""

    def build(self) -> Joint:
        """Build the joint in SI units."""
        stiffness = self.stiffness_n_per_um * 1e6
        return Joint(self.position_mm / 1e3, stiffness, self.rotational_stiffness_n_m_per_rad, group=self.group)


class SpindleTable(TomlTable, frozen=True):
    """Table [spindle]: the spindle model."""

    segments: Annotated[list[SegmentTable], Meta(min_length=1)]
    bearings: Annotated[list[BearingTable], Meta(min_length=1)]
    bearing_stiffness_n_per_um: Annotated[Positive, Plausible(5, 4999)]
    masses: tuple[MassTable, ...] = ()
    joints: tuple[JointTable, ...] = ()
    theory: Theory = "euler-bernoulli"
    youngs_modulus_gpa: Annotated[Positive, Plausible(10, 700)] = 210.0
    shear_modulus_gpa: Annotated[Positive, Plausible(2, 300)] | None = None
    axial_poisson_ratio: Annotated[float, Meta(ge=0, le=0.5), Plausible(0.01, 0.5)] | UnsetType = (
        UNSET  # not in old hashes
    )
    density_kg_per_m3: Annotated[Positive, Plausible(1000, 20_000)] = 7850.0
    damping_ratio: Annotated[float, Meta(gt=0, lt=1), Plausible(0.001, 0.3)] = 0.03
    tool_length_mm: Annotated[Positive, Plausible(3, 1000)] | None = None
    tolerance: Annotated[float, Meta(ge=0, le=0.1), Plausible(0.0002, 0.1)] = 0.01
    label: str = ""

    def __post_init__(self) -> None:
        length = sum(segment.length_mm for segment in self.segments)
        kinds: dict[str, Sequence[Any]] = {"bearing": self.bearings, "mass": self.masses, "joint": self.joints}
        for kind, parts in kinds.items():
            for i, part in enumerate(parts, 1):
                if part.position_mm > length:
                    place = f"position_mm={part.position_mm:g} is outside the shaft, 0 to {length:g} mm"
                    raise ValueError(f"{kind} {i}: {place}")
        first = min(bearing.position_mm for bearing in self.bearings)
        if self.tool_length_mm is not None and self.tool_length_mm > first:
            problem = f"tool_length_mm={self.tool_length_mm:g} reaches beyond the first bearing at {first:g} mm"
            raise ValueError(f"{problem}. Give the length of the tool only.")
        try:
            self.build()
        except ValueError as error:
            raise ValueError(f"in SI units: {error}") from error

    def build(self) -> Spindle:
        """Build the spindle in SI units."""
        return Spindle(
            [segment.build() for segment in self.segments],
            [bearing.build(self.bearing_stiffness_n_per_um) for bearing in self.bearings],
            youngs_modulus=self.youngs_modulus_gpa * 1e9,
            density=self.density_kg_per_m3,
            theory=self.theory,
            shear_modulus=None if self.shear_modulus_gpa is None else self.shear_modulus_gpa * 1e9,
            masses=[mass.build() for mass in self.masses],
            joints=[joint.build() for joint in self.joints],
            axial_poisson_ratio=None if self.axial_poisson_ratio is UNSET else self.axial_poisson_ratio,
        )


def _check_wall(bore: float, outer: float, bore_key: str, outer_key: str) -> None:
    if bore >= outer:
        raise ValueError(f"{bore_key}={bore:g} is not smaller than {outer_key}={outer:g}")


class ToolTable(TomlTable, frozen=True):
    """Table [[tool]]; segments from the tip to the holder are for a tool that the model predicts."""

    name: Annotated[str, Meta(min_length=1)]
    segments: tuple[SegmentTable, ...] = ()
    masses: tuple[MassTable, ...] = ()
    pitch_deg: tuple[float, ...] | None = None
    teeth: Annotated[int, Meta(ge=1), Plausible(1, 40)] | None = None
    diameter_mm: Annotated[Positive, Plausible(0.3, 299)] | None = None
    helix_deg: Annotated[float, Meta(ge=0, lt=90), Plausible(1, 70)] | None = None
    flute_length_mm: Annotated[Positive, Plausible(0.5, 499)] | None = None
    stick_out_mm: Annotated[Positive, Plausible(3, 1000)] | None = None
    shank_diameter_mm: Annotated[Positive, Plausible(2, 150)] | None = None
    tool_material: ToolMaterial | None = None
    cutting_speed_m_min: Annotated[Positive | ValueRange, Plausible(5, 4999)] | None = None
    feed_per_tooth_mm: Annotated[Positive | ValueRange, Plausible(0.002, 1.9)] | None = None
    max_speed_rpm: Annotated[Positive, Plausible(300, 250_000)] | None = None

    def __post_init__(self) -> None:
        convert_pitch(self.pitch_deg, self.teeth or len(self.pitch_deg or ()))
        for key in ("cutting_speed_m_min", "feed_per_tooth_mm"):
            value = getattr(self, key)
            if isinstance(value, tuple) and value[0] > value[1]:
                cure = "Give [smallest, largest], or only the largest."
                raise ValueError(f"{key}=[{value[0]:g}, {value[1]:g}] is not in rising order. {cure}")
        if self.masses and not self.segments:
            raise ValueError("masses need segments. Add the segments of the tool, or remove the masses.")

    def build(self, spindle: Spindle) -> Spindle:
        """Build the tool as a free shaft in SI units, with defaults of the spindle."""
        segments, masses = [part.build() for part in self.segments], [mass.build() for mass in self.masses]
        return replace(spindle, segments=segments, bearings=(), masses=masses, joints=())
