"""Check numbers of machine.toml against plausible ranges.

All ranges are chosen: what shops have, with room beside it, and where that can be had less than a factor of 1000 wide,
so that a slip of 1000 leaves them. docs/plausible.md says which slips are not seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from acquisition import Remark
from lobewatch.machine.settings.cut_tables import CutTable, DriveTable, MaterialTable, ProgramTable, UncertaintyTable
from lobewatch.machine.settings.setup_tables import (
    ChannelTable,
    DaqTable,
    LimitsTable,
    MachineTable,
    ModeTable,
    SpeedTable,
    TapTable,
)
from lobewatch.machine.settings.spindle_tables import (
    BearingTable,
    JointTable,
    MassTable,
    SegmentTable,
    SpindleTable,
    ToolTable,
)
from lobewatch.machine.settings.toml_schema import TomlTable

PlausibleRange = tuple[float, float]
KT_RANGE = (200.0, 6000.0)
"""Kt (N/mm2)."""
KR_RATIO_RANGE = (0.01, 1.2)
"""Kr/Kt where it is not 0."""
STICK_OUT_RATIO_RANGE = (0.8, 15.0)
"""Length of a tool out of its holder over its diameter."""
DEPTH_RATIO_RANGE = (0.002, 2.0)
"""Axial depth over diameter."""
FLUTE_LENGTH_RATIO_RANGE = (0.2, 15.0)
"""Length of flutes over diameter."""
RADIAL_DEPTH_RATIO_RANGE = (0.005, 1.0)
"""Radial depth over diameter."""
CUTTING_SPEED_RANGE = (3.0, 6000.0)
"""Speed of the edge (m/min)."""
GYRATION_RADIUS_RANGE = (5.0, 500.0)
"""Radius of gyration of a lumped mass (mm)."""
PLAUSIBLE_RANGES: Mapping[type[TomlTable], Mapping[str, PlausibleRange]] = {
    MachineTable: {"tap_interval_days": (0.5, 400)},
    TapTable: {
        "record_s": (0.01, 9),
        "pre_trigger_s": (0.001, 0.9),
        "trigger_n": (0.2, 199),
        "position_mm": (1, 999),
        "stick_out_mm": (3, 1000),
        "drawbar_kn": (0.5, 150),
        "sensor_mass_g": (0.1, 99),
        "cable_mass_g": (0.1, 99),
        "sensor_band_hz": (100, 99_000),
    },
    DaqTable: {"sample_rate_hz": (1000, 999_999), "calibration_interval_months": (1, 120)},
    ChannelTable: {
        "range_v": (0.05, 40),
        "sensitivity_mv_per_n": (0.08, 30),
        "sensitivity_mv_per_g": (0.8, 799),
        "gain": (0.2, 199),
        "skew_us": (0.05, 49),
    },
    ModeTable: {"band_hz": (5, 100_000)},
    LimitsTable: {"frequency_warn_percent": (0.1, 60), "frequency_alarm_percent": (0.1, 60)},
    SpeedTable: {"low_rpm": (10, 60_000), "high_rpm": (300, 250_000)},
    DriveTable: {"power_kw": (0.1, 99), "torque_nm": (0.05, 5000)},
    UncertaintyTable: {
        "frequency_percent": (0.01, 9),
        "damping_percent": (0.5, 100),
        "stiffness_percent": (0.1, 50),
        "speed_percent": (0.02, 10),
        "coefficients_percent": (1, 100),
        "predicted_frequency_percent": (0.1, 50),
        "predicted_damping_percent": (1, 100),
        "predicted_stiffness_percent": (0.5, 100),
        "untapped_frequency_percent": (0.1, 50),
        "untapped_stiffness_percent": (1, 100),
    },
    CutTable: {
        "teeth": (1, 40),
        "tool_diameter_mm": (0.3, 299),
        "helix_deg": (1, 70),
        "feed_per_tooth_mm": (0.002, 1.9),
        "tangential_n_per_mm2": KT_RANGE,
        "corner_radius_mm": (0.2, 199),
    },
    MaterialTable: {
        "tangential_n_per_mm2": KT_RANGE,
        "specific_force_n_per_mm2": KT_RANGE,
        "force_angle_deg": (39, 90),
        "tangential_edge_n_per_mm": (0.5, 400),
        "radial_edge_n_per_mm": (0.5, 400),
    },
    SpindleTable: {
        "bearing_stiffness_n_per_um": (5, 4999),
        "youngs_modulus_gpa": (10, 700),
        "shear_modulus_gpa": (5, 300),
        "density_kg_per_m3": (1000, 20_000),
        "damping_ratio": (0.001, 0.3),
        "tool_length_mm": (3, 1000),
        "tolerance": (0.0002, 0.1),
    },
    SegmentTable: {
        **dict.fromkeys(("length_mm", "outer_mm", "bore_mm"), (0.6, 599)),
        **dict.fromkeys(("end_outer_mm", "end_bore_mm", "mass_outer_mm"), (0.6, 599)),
    },
    BearingTable: {
        "position_mm": (1, 999),
        "stiffness_n_per_um": (5, 4999),
        "damping_n_s_per_m": (5, 50_000),
        "rotational_stiffness_n_m_per_rad": (100, 9e6),
        "housing_stiffness_n_per_um": (5, 9999),
    },
    MassTable: {"position_mm": (1, 999), "mass_kg": (0.02, 199)},
    ToolTable: {
        "teeth": (1, 40),
        "diameter_mm": (0.3, 299),
        "helix_deg": (1, 70),
        "flute_length_mm": (0.5, 499),
        "cutting_speed_m_min": (5, 4999),
        "feed_per_tooth_mm": (0.002, 1.9),
        "max_speed_rpm": (300, 250_000),
    },
    JointTable: {
        "position_mm": (1, 999),
        "stiffness_n_per_um": (20, 1e5),
        "rotational_stiffness_n_m_per_rad": (1e4, 2e8),
    },
}
"""Ranges by table and key, in the units of the key; 0 and infinity stand for "none" and are not asked about."""
TEMPLATE_COEFFICIENTS, TEMPLATE_BEARING_STIFFNESS = (700.0, 250.0), 500.0
"""Kt and Kr (N/mm2), and stiffness of a bearing (N/um), that stand in a new machine.toml: nobody's."""


class ImplausibleSetting(NamedTuple):
    """A number that is asked about."""

    code: str
    """Code of the question."""
    location: str
    """Table that it stands in, for people."""
    key: str
    """Key in that table."""
    value: str
    """Value of it."""
    reason: str
    """What speaks against it."""

    @property
    def statement(self) -> str:
        """Words that a person accepts, and that stand in [machine] accepted."""
        return " ".join(filter(None, [self.location, f"{self.key} = {self.value}"]))

    @property
    def remark(self) -> Remark:
        """The question."""
        cure = f"correct it in machine.toml, or, where it is right: lobewatch check MACHINE --accept {self.key}"
        return Remark(self.code, self.location, f"{self.key} = {self.value} {self.reason}", cure)


def check_ranges(table: TomlTable, place: str) -> Iterator[ImplausibleSetting]:
    """Numbers of one table that lie outside what shops have."""
    for kind, ranges in PLAUSIBLE_RANGES.items():
        if isinstance(table, kind):
            for key, limits in ranges.items():
                value = getattr(table, key, None)
                for number in value if isinstance(value, tuple) else (value,):
                    if isinstance(number, int | float) and not isinstance(number, bool):
                        yield from _check_range(place, key, abs(number), limits)


def _check_range(place: str, key: str, number: float, limits: PlausibleRange) -> Iterator[ImplausibleSetting]:
    low, high = limits
    if number != 0 and math.isfinite(number) and not low <= number <= high:
        yield ImplausibleSetting("setting-not-plausible", place, key, f"{number:g}", f"is outside {low:g} to {high:g}")


def _check_ratio(
    place: str, key: str, value: float, over: float, limits: PlausibleRange, words: str
) -> Iterator[ImplausibleSetting]:
    """Asked where a number over another one lies outside limits."""
    low, high = limits
    if value and not low <= value / over <= high:
        why = f"is {value / over:.3g} {words}, not {low:g} to {high:g}"
        yield ImplausibleSetting("setting-not-plausible", place, key, f"{value:g}", why)


def check_cut(cut: CutTable, place: str) -> Iterator[ImplausibleSetting]:
    """A program or the reference cut: each number, and numbers that do not go together."""
    yield from check_ranges(cut, place)
    diameter = cut.tool_diameter_mm
    if cut.tangential_n_per_mm2 and cut.radial_n_per_mm2 is not None:
        key, kt = "radial_n_per_mm2", cut.tangential_n_per_mm2
        yield from _check_ratio(place, key, cut.radial_n_per_mm2, kt, KR_RATIO_RANGE, "times tangential_n_per_mm2")
        if (kt, cut.radial_n_per_mm2) == TEMPLATE_COEFFICIENTS:
            why = "with radial_n_per_mm2 = 250 is what a new machine.toml holds: nobody has given it"
            yield ImplausibleSetting("setting-guessed", place, "tangential_n_per_mm2", f"{kt:g}", why)
    for radial in dict.fromkeys(cut.radial_mm):
        yield from _check_ratio(place, "radial_depth_mm", radial, diameter, RADIAL_DEPTH_RATIO_RANGE, "diameters")
    if cut.flute_length_mm is not None:
        yield from _check_ratio(
            place, "flute_length_mm", cut.flute_length_mm, diameter, FLUTE_LENGTH_RATIO_RANGE, "diameters"
        )
    if isinstance(cut, ProgramTable):
        yield from _check_ratio(place, "depth_mm", cut.depth_mm, diameter, DEPTH_RATIO_RANGE, "diameters")
        speed = math.pi * diameter / 1000 * cut.speed_rpm
        yield from _check_ratio(
            place, "speed_rpm", cut.speed_rpm, cut.speed_rpm / speed, CUTTING_SPEED_RANGE, "m/min at the edge"
        )


def check_material(material: MaterialTable, place: str) -> Iterator[ImplausibleSetting]:
    """A [[material]]."""
    yield from check_ranges(material, place)
    if material.tangential_n_per_mm2 and material.radial_n_per_mm2:
        kt, kr = material.tangential_n_per_mm2, material.radial_n_per_mm2
        yield from _check_ratio(place, "radial_n_per_mm2", kr, kt, KR_RATIO_RANGE, "times tangential_n_per_mm2")


def check_drive(drive: DriveTable, speeds: SpeedTable) -> Iterator[ImplausibleSetting]:
    """Power and torque, and the speed from which on the power is there."""
    yield from check_ranges(drive, "[drive]")
    if math.isfinite(drive.power_kw) and math.isfinite(drive.torque_nm):
        corner = 1000 * drive.power_kw / drive.torque_nm * 30 / math.pi
        if not 50 <= corner <= 2 * speeds.high_rpm:
            why = f"and torque_nm = {drive.torque_nm:g} meet at {corner:.3g} rpm, where [speed] ends at "
            why += f"{speeds.high_rpm:g}"
            yield ImplausibleSetting("settings-contradict", "[drive]", "power_kw", f"{drive.power_kw:g}", why)


def check_stick_out(tap: TapTable, cuts: Mapping[str, CutTable]) -> Iterator[ImplausibleSetting]:
    """The length of the tapped tool against its diameter; cuts: those of that tool, by their places."""
    if tap.stick_out_mm is not None:
        for cut in cuts.values():
            words = f"diameters of {cut.tool_diameter_mm:g} mm"
            yield from _check_ratio(
                "[tap]", "stick_out_mm", tap.stick_out_mm, cut.tool_diameter_mm, STICK_OUT_RATIO_RANGE, words
            )


def check_same_tool(programs: Mapping[str, ProgramTable]) -> Iterator[ImplausibleSetting]:
    """Programs of one tool that do not agree on its diameter or its teeth; programs: by their places."""
    for place, program in programs.items():
        for key in ("tool_diameter_mm", "teeth"):
            value = getattr(program, key)
            others = [other for other in programs.values() if getattr(other, key) != value]
            if others:
                why = f"where {others[0].name!r} of the same tool has {getattr(others[0], key):g}: a radius, an inch, "
                yield ImplausibleSetting("settings-contradict", place, key, f"{value:g}", f"{why}another tool?")


def check_program_tool(program: ProgramTable, tool: ToolTable, place: str) -> Iterator[ImplausibleSetting]:
    """A program that does not agree with the [[tool]] that it runs with."""
    for key, its_key in (
        ("teeth", "teeth"),
        ("tool_diameter_mm", "diameter_mm"),
        ("flute_length_mm", "flute_length_mm"),
    ):
        value, its = getattr(program, key), getattr(tool, its_key)
        if None not in (value, its) and value != its:
            why = f"where {its_key} of [[tool]] {tool.name!r} is {its:g}: a radius, an inch, another tool?"
            yield ImplausibleSetting("settings-contradict", place, key, f"{value:g}", why)


def check_spindle(spindle: SpindleTable) -> Iterator[ImplausibleSetting]:
    """All parts of the model."""
    yield from check_ranges(spindle, "[spindle]")
    lists: dict[str, Sequence[TomlTable]] = {
        "segment": spindle.segments,
        "bearing": spindle.bearings,
        "joint": spindle.joints,
    }
    for kind, parts in lists.items():
        for i, part in enumerate(parts, 1):
            yield from check_ranges(part, f"[spindle] {kind} {i}")
    for i, mass in enumerate(spindle.masses, 1):
        yield from check_mass(mass, f"[spindle] mass {i}")


def check_mass(mass: MassTable, place: str) -> Iterator[ImplausibleSetting]:
    """A lumped mass, and how far out it lies."""
    yield from check_ranges(mass, place)
    for key in ("diametral_inertia_kg_mm2", "polar_inertia_kg_mm2"):
        if (inertia := getattr(mass, key)) and mass.mass_kg:
            radius = math.sqrt(inertia / mass.mass_kg)
            if not GYRATION_RADIUS_RANGE[0] <= radius <= GYRATION_RADIUS_RANGE[1]:
                why = f"with {mass.mass_kg:g} kg lies at {radius:.3g} mm from the axis"
                yield ImplausibleSetting("setting-not-plausible", place, key, f"{inertia:g}", why)


def check_tool(tool: ToolTable, place: str) -> Iterator[ImplausibleSetting]:
    """A [[tool]]."""
    yield from check_ranges(tool, place)
    if tool.flute_length_mm is not None and tool.diameter_mm is not None:
        yield from _check_ratio(
            place, "flute_length_mm", tool.flute_length_mm, tool.diameter_mm, FLUTE_LENGTH_RATIO_RANGE, "diameters"
        )


def check_tool_shape(tool: ToolTable, place: str) -> Iterator[ImplausibleSetting]:
    """Parts of a [[tool]], and how slender it is."""
    for i, segment in enumerate(tool.segments, 1):
        yield from check_ranges(segment, f"{place} segment {i}")
    for i, mass in enumerate(tool.masses, 1):
        yield from check_mass(mass, f"{place} mass {i}")
    if not tool.segments:
        return
    length, thickest = sum(part.length_mm for part in tool.segments), max(part.outer_mm for part in tool.segments)
    if length > STICK_OUT_RATIO_RANGE[1] * thickest:
        why = f"add up to {length / thickest:.3g} diameters, more than {STICK_OUT_RATIO_RANGE[1]:g}"
        yield ImplausibleSetting("setting-not-plausible", place, "segments", f"{length:g} mm", why)
