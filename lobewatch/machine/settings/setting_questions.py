"""Questions about implausible settings of machine.toml."""

import hashlib
import math
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import NamedTuple

import msgspec

from acquisition import Remark
from lobes import fold_material_name
from lobewatch.machine.settings.cut_tables import CutTable, MaterialTable, ProgramTable
from lobewatch.machine.settings.display_units import CUTTING_SPEED, LENGTH
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.machine.settings.spindle_tables import MassTable, SpindleTable, ToolTable
from lobewatch.machine.settings.toml import TomlTable, find_plausible_ranges


class RatioRange(NamedTuple):
    """Plausible range of a number over another one."""

    low: float
    """Smallest plausible ratio."""
    high: float
    """Largest plausible ratio."""
    unit: str = "diameters"
    """Unit of the ratio in a sentence."""

    def holds(self, ratio: float) -> bool:
        return self.low <= ratio <= self.high


KR_RATIO_RANGE = RatioRange(0.01, 1.2, "times tangential_n_per_mm2")
"""Kr/Kt where it is not 0."""
STICK_OUT_RATIO_RANGE = RatioRange(0.8, 15.0)
"""Stick-out of a tool over its diameter."""
DEPTH_RATIO_RANGE = RatioRange(0.002, 2.0)
"""Axial depth of cut ap over diameter."""
FLUTE_LENGTH_RATIO_RANGE = RatioRange(0.2, 15.0)
"""Flute length over diameter."""
RADIAL_DEPTH_RATIO_RANGE = RatioRange(0.005, 1.0)
"""Radial depth of cut ae over diameter."""
CUTTING_SPEED_RANGE = RatioRange(3.0, 6000.0)
"""Cutting speed (m/min), as a ratio to 1 m/min."""
GYRATION_RADIUS_RANGE = RatioRange(5.0, 500.0, "mm radius of gyration")
"""Radius of gyration of a lumped mass (mm), as a ratio to 1 mm."""
LIKELY_MISTAKES = "(radius, inch or another tool?)"
"""Usual mistakes in a dimension of a tool."""
TEMPLATE_COEFFICIENTS, TEMPLATE_BEARING_STIFFNESS = (700.0, 250.0), 500.0
"""Kt and Kr (N/mm2), and bearing stiffness (N/um), of the template of machine.toml."""


class SettingFault(StrEnum):
    """Kind of an implausible setting; the value is the code of its remark."""

    OUT_OF_RANGE = "setting-not-plausible"
    """Number outside the plausible range."""
    CONTRADICTION = "settings-contradict"
    """Number that contradicts another one."""
    TEMPLATE_VALUE = "setting-guessed"
    """Number of the template that was not replaced."""


class ImplausibleSetting(NamedTuple):
    """Number of machine.toml that is probably a mistake."""

    fault: SettingFault
    """Kind of the mistake."""
    location: str
    """Table of the number, in words."""
    key: str
    """Key in that table."""
    value: str
    """Value of the key."""
    reason: str
    """Reason of the question."""

    @property
    def statement(self) -> str:
        """Line for [machine] accepted that confirms the number."""
        return " ".join(filter(None, [self.location, f"{self.key} = {self.value}"]))

    @property
    def remark(self) -> Remark:
        """Question about the number, with its remedy."""
        cure = f"Correct the value in machine.toml, or confirm it with folder_updates.accept_settings {self.key}"
        return Remark(self.fault.value, self.location, f"{self.key} = {self.value} {self.reason}", cure)


HASH_SALT = b"four words over the doubt, plausible or asked".decode()
"""First part of every hash. It never changes: stored verdicts are found by it."""


def find_program_questions(machine: Machine, program: ProgramTable, on_model: bool) -> list[ImplausibleSetting]:
    """Return the open questions for the verdict on a program; on_model: whether the verdict uses [spindle]."""
    questions = [*_check_program(machine, program), *(_check_model(machine, program) if on_model else ())]
    return _remove_accepted(machine, questions)


def find_all_questions(machine: Machine) -> list[ImplausibleSetting]:
    """Return all open questions about a machine.toml."""
    questions = [*_check_machine(machine)]
    for program in machine.program:
        questions += [*_check_program(machine, program), *_check_model(machine, program)]
    if machine.spindle is not None:
        questions += _check_spindle(machine.spindle)
    if machine.reference_cut is not None:
        questions += _check_cut_and_material(machine, machine.reference_cut, "[reference_cut]")
    return _remove_accepted(machine, questions)


def find_template_bearings(machine: Machine) -> ImplausibleSetting | None:
    """Return the question about a bearing stiffness that is still that of the template; None if replaced."""
    template, key = TEMPLATE_BEARING_STIFFNESS, "bearing_stiffness_n_per_um"
    if machine.spindle is None or machine.spindle.bearing_stiffness_n_per_um != template:
        return None
    why = "is the default of a new machine.toml, not yet calibrated by a tap test"
    question = ImplausibleSetting(SettingFault.TEMPLATE_VALUE, "[spindle]", key, f"{template:g}", why)
    return next(iter(_remove_accepted(machine, [question])), None)


def hash_programs(machine: Machine) -> dict[str, str]:
    """Return the SHA-256 of all settings that decide the verdict on each program, besides `Machine.settings_hash`.

    The sources of the cutting coefficients are part of it: another text there makes stored verdicts unknown.
    """
    hashes = {}
    for program in machine.program:
        questions = [question.statement for question in find_program_questions(machine, program, on_model=True)]
        tool = machine.pitch_deg(program), machine.helix_deg(program)
        drop = machine.speed.drop_range(program.speed_rpm)
        decisive = program, tool, machine.coefficients(program), machine.doubt, questions, drop
        content = msgspec.json.encode((HASH_SALT, *decisive))
        hashes[program.name] = hashlib.sha256(content).hexdigest()
    return hashes


def _remove_accepted(machine: Machine, questions: list[ImplausibleSetting]) -> list[ImplausibleSetting]:
    by_statement = {question.statement: question for question in questions}
    return [question for statement, question in by_statement.items() if statement not in machine.machine.accepted]


def _check_machine(machine: Machine) -> Iterator[ImplausibleSetting]:
    for name in ("machine", "tap", "daq", "mode", "limits", "speed", "doubt"):
        yield from _check_ranges(getattr(machine, name), f"[{name}]")
    for i, channel in enumerate(machine.daq.channel, 1):
        yield from _check_ranges(channel, f"[[daq.channel]] {i}")
    yield from _check_ranges(machine.drive, "[drive]")
    drive = machine.drive
    if math.isfinite(drive.power_kw) and math.isfinite(drive.torque_nm):
        corner = 1000 * drive.power_kw / drive.torque_nm * 30 / math.pi  # speed with full power and full torque
        if not 50 <= corner <= 2 * machine.speed.high_rpm:
            limits = f"outside 50 to {2 * machine.speed.high_rpm:g} rpm"
            why = f"with torque_nm = {drive.torque_nm:g} gives a base speed of {corner:.3g} rpm, {limits}"
            yield ImplausibleSetting(SettingFault.CONTRADICTION, "[drive]", "power_kw", f"{drive.power_kw:g}", why)


def _check_program(machine: Machine, program: ProgramTable) -> Iterator[ImplausibleSetting]:
    yield from _check_machine(machine)
    place = f"program {program.name!r}"
    yield from _check_cut_and_material(machine, program, place)
    if program in machine.program:  # a requested cut takes its geometry from these programs
        yield from _check_same_tool(machine, program, place)
    tool = machine.find_tool(program)
    if tool is not None:
        yield from _check_program_tool(program, tool, place)
    if program.tool == machine.tap.tool and machine.tap.stick_out_mm is not None:
        diameter = program.tool_diameter_mm
        limits = STICK_OUT_RATIO_RANGE._replace(unit=f"diameters of {LENGTH.text(diameter)}")
        yield from _check_ratio("[tap]", "stick_out_mm", machine.tap.stick_out_mm, diameter, limits)


def _check_cut_and_material(machine: Machine, cut: CutTable, place: str) -> Iterator[ImplausibleSetting]:
    yield from _check_cut(cut, place)
    for material in machine.material:
        if cut.material is not None and fold_material_name(material.name) == fold_material_name(cut.material):
            place = f"material {material.name!r}"
            yield from _check_ranges(material, place)
            if material.tangential_n_per_mm2 and material.radial_n_per_mm2:
                yield from _check_radial_coefficient(material, place)


def _check_cut(cut: CutTable, place: str) -> Iterator[ImplausibleSetting]:
    yield from _check_ranges(cut, place)
    diameter = cut.tool_diameter_mm
    if cut.tangential_n_per_mm2 and cut.radial_n_per_mm2 is not None:
        yield from _check_radial_coefficient(cut, place)
        if (cut.tangential_n_per_mm2, cut.radial_n_per_mm2) == TEMPLATE_COEFFICIENTS:
            kt, kr = TEMPLATE_COEFFICIENTS
            why = f"with radial_n_per_mm2 = {kr:g} is the default of a new machine.toml, not of your material"
            yield ImplausibleSetting(SettingFault.TEMPLATE_VALUE, place, "tangential_n_per_mm2", f"{kt:g}", why)
    for radial in dict.fromkeys(cut.radial_mm):
        yield from _check_ratio(place, "radial_depth_mm", radial, diameter, RADIAL_DEPTH_RATIO_RANGE)
    if cut.flute_length_mm is not None:
        yield from _check_ratio(place, "flute_length_mm", cut.flute_length_mm, diameter, FLUTE_LENGTH_RATIO_RANGE)
    if isinstance(cut, ProgramTable):
        yield from _check_ratio(place, "depth_mm", cut.depth_mm, diameter, DEPTH_RATIO_RANGE)
        scale, (low, high, _) = CUTTING_SPEED.scale, CUTTING_SPEED_RANGE
        speed = math.pi * diameter / 1000 * cut.speed_rpm * scale
        limits = RatioRange(low * scale, high * scale, f"{CUTTING_SPEED.unit} at the edge")
        yield from _check_ratio(place, "speed_rpm", cut.speed_rpm, cut.speed_rpm / speed, limits)


def _check_radial_coefficient(table: CutTable | MaterialTable, place: str) -> Iterator[ImplausibleSetting]:
    kt, kr = table.tangential_n_per_mm2 or math.nan, table.radial_n_per_mm2 or 0.0
    return _check_ratio(place, "radial_n_per_mm2", kr, kt, KR_RATIO_RANGE)


def _check_same_tool(machine: Machine, program: ProgramTable, place: str) -> Iterator[ImplausibleSetting]:
    """Yield diameter or teeth of a program that another program of its tool contradicts."""
    same_tool = [other for other in machine.program if other.tool == program.tool]
    for key in ("tool_diameter_mm", "teeth"):
        value = getattr(program, key)
        for other in [other for other in same_tool if getattr(other, key) != value][:1]:
            why = f"differs from {getattr(other, key):g} of program {other.name!r} with the same tool {LIKELY_MISTAKES}"
            yield ImplausibleSetting(SettingFault.CONTRADICTION, place, key, f"{value:g}", why)


def _check_program_tool(program: ProgramTable, tool: ToolTable, place: str) -> Iterator[ImplausibleSetting]:
    """Yield implausible values of a [[tool]], and values of its program that it contradicts."""
    name, limits = f"tool {tool.name!r}", FLUTE_LENGTH_RATIO_RANGE
    yield from _check_ranges(tool, name)
    if tool.flute_length_mm is not None and tool.diameter_mm is not None:
        yield from _check_ratio(name, "flute_length_mm", tool.flute_length_mm, tool.diameter_mm, limits)
    for key in ("teeth", "tool_diameter_mm", "flute_length_mm"):
        tool_key = key.removeprefix("tool_")
        value, tool_value = getattr(program, key), getattr(tool, tool_key)
        if None not in (value, tool_value) and value != tool_value:
            why = f"differs from {tool_key} = {tool_value:g} of [[tool]] {tool.name!r} {LIKELY_MISTAKES}"
            yield ImplausibleSetting(SettingFault.CONTRADICTION, place, key, f"{value:g}", why)


def _check_model(machine: Machine, program: ProgramTable) -> Iterator[ImplausibleSetting]:
    if machine.spindle is not None:
        yield from _check_spindle(machine.spindle)
    tool = machine.find_tool(program)
    if tool is not None:
        yield from _check_tool_shape(tool)


def _check_spindle(spindle: SpindleTable) -> Iterator[ImplausibleSetting]:
    yield from _check_ranges(spindle, "[spindle]")
    yield from _check_parts("[spindle] segment", spindle.segments)
    yield from _check_parts("[spindle] bearing", spindle.bearings)
    yield from _check_parts("[spindle] joint", spindle.joints)
    yield from _check_parts("[spindle] mass", spindle.masses)


def _check_parts(place: str, parts: Sequence[TomlTable]) -> Iterator[ImplausibleSetting]:
    for i, part in enumerate(parts, 1):
        yield from _check_ranges(part, f"{place} {i}")
        mass = part.mass_kg if isinstance(part, MassTable) else 0.0
        for key in ("diametral_inertia_kg_mm2", "polar_inertia_kg_mm2") if mass else ():
            inertia = getattr(part, key)
            radius = math.sqrt(inertia / mass)
            if inertia and not GYRATION_RADIUS_RANGE.holds(radius):
                low, high, unit = GYRATION_RADIUS_RANGE
                why = f"with {mass:g} kg gives {radius:.3g} {unit}, outside {low:g} to {high:g}"
                yield ImplausibleSetting(SettingFault.OUT_OF_RANGE, f"{place} {i}", key, f"{inertia:g}", why)


def _check_tool_shape(tool: ToolTable) -> Iterator[ImplausibleSetting]:
    place = f"tool {tool.name!r}"
    yield from _check_parts(f"{place} segment", tool.segments)
    yield from _check_parts(f"{place} mass", tool.masses)
    if not tool.segments:
        return
    length, thickest = sum(part.length_mm for part in tool.segments), max(part.outer_mm for part in tool.segments)
    limits = STICK_OUT_RATIO_RANGE
    if length > limits.high * thickest:
        why = f"add up to {length / thickest:.3g} {limits.unit}, more than {limits.high:g}"
        yield ImplausibleSetting(SettingFault.OUT_OF_RANGE, place, "segments", f"{length:g} mm", why)


def _check_ranges(table: TomlTable, place: str) -> Iterator[ImplausibleSetting]:
    """Yield the numbers of a table that are outside of their plausible ranges; 0 and infinity mean "none"."""
    for key, (low, high) in find_plausible_ranges(type(table)).items():
        value = getattr(table, key)
        for item in value if isinstance(value, tuple) else (value,):
            number = abs(item or 0.0)
            if number != 0 and math.isfinite(number) and not low <= number <= high:
                why = f"is outside {low:g} to {high:g}"
                yield ImplausibleSetting(SettingFault.OUT_OF_RANGE, place, key, f"{number:g}", why)


def _check_ratio(place: str, key: str, value: float, over: float, limits: RatioRange) -> Iterator[ImplausibleSetting]:
    """Yield a number whose ratio to another one is outside its plausible range."""
    if value and not limits.holds(value / over):
        why = f"is {value / over:.3g} {limits.unit}, outside {limits.low:g} to {limits.high:g}"
        yield ImplausibleSetting(SettingFault.OUT_OF_RANGE, place, key, f"{value:g}", why)
