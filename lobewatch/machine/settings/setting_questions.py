"""What a machine.toml is asked about before a word is said of a program, and which of it was accepted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from lobes import fold_material_name
from lobewatch.machine.settings.cut_tables import CutTable, DriveTable, MaterialTable, ProgramTable, UncertaintyTable
from lobewatch.machine.settings.plausibility import (
    TEMPLATE_BEARING_STIFFNESS,
    ImplausibleSetting,
    check_cut,
    check_drive,
    check_material,
    check_program_tool,
    check_ranges,
    check_same_tool,
    check_spindle,
    check_stick_out,
    check_tool,
    check_tool_shape,
)
from lobewatch.machine.settings.setup_tables import DaqTable, LimitsTable, MachineTable, ModeTable, SpeedTable, TapTable
from lobewatch.machine.settings.spindle_tables import SpindleTable, ToolTable


class MachineTables(Protocol):
    """The tables of machine.toml, as `Machine` has them."""

    @property
    def machine(self) -> MachineTable: ...  # noqa: D102
    @property
    def tap(self) -> TapTable: ...  # noqa: D102
    @property
    def daq(self) -> DaqTable: ...  # noqa: D102
    @property
    def mode(self) -> ModeTable: ...  # noqa: D102
    @property
    def limits(self) -> LimitsTable: ...  # noqa: D102
    @property
    def speed(self) -> SpeedTable: ...  # noqa: D102
    @property
    def drive(self) -> DriveTable: ...  # noqa: D102
    @property
    def doubt(self) -> UncertaintyTable: ...  # noqa: D102
    @property
    def material(self) -> Sequence[MaterialTable]: ...  # noqa: D102
    @property
    def reference_cut(self) -> CutTable | None: ...  # noqa: D102
    @property
    def program(self) -> Sequence[ProgramTable]: ...  # noqa: D102
    @property
    def spindle(self) -> SpindleTable | None: ...  # noqa: D102
    @property
    def tool(self) -> Sequence[ToolTable]: ...  # noqa: D102


def find_program_questions(machine: MachineTables, program: ProgramTable, on_model: bool) -> list[ImplausibleSetting]:
    """Open questions that the word on a program waits for; on_model: whether that rests on [spindle], too."""
    return _remove_accepted(
        machine, [*_check_program(machine, program), *(_check_model(machine, program) if on_model else ())]
    )


def find_all_questions(machine: MachineTables) -> list[ImplausibleSetting]:
    """All open questions of a machine.toml."""
    asked = [*_check_machine(machine)]
    for program in machine.program:
        asked += _check_program(machine, program)
        asked += _check_model(machine, program)
    if machine.spindle is not None:
        asked += check_spindle(machine.spindle)
    if machine.reference_cut is not None:
        asked += _check_cut_and_material(machine, machine.reference_cut, "[reference_cut]")
    return _remove_accepted(machine, asked)


def find_template_bearings(machine: MachineTables) -> ImplausibleSetting | None:
    """Question about a bearing stiffness that nobody has given; None where somebody has, or has accepted it."""
    spindle = machine.spindle
    if spindle is None or spindle.bearing_stiffness_n_per_um != TEMPLATE_BEARING_STIFFNESS:
        return None
    why = "is what a new machine.toml holds, and no tap test has found it yet: all of the model rests on it"
    key = "bearing_stiffness_n_per_um"
    asked = ImplausibleSetting("setting-guessed", "[spindle]", key, f"{TEMPLATE_BEARING_STIFFNESS:g}", why)
    return next(iter(_remove_accepted(machine, [asked])), None)


def _remove_accepted(machine: MachineTables, asked: list[ImplausibleSetting]) -> list[ImplausibleSetting]:
    """Each question once, without those that a person has answered."""
    by_claim = {doubted.statement: doubted for doubted in asked}
    return [doubted for claim, doubted in by_claim.items() if claim not in machine.machine.accepted]


def _check_machine(machine: MachineTables) -> Iterator[ImplausibleSetting]:
    """What every word rests on."""
    tables = {
        "[machine]": machine.machine,
        "[tap]": machine.tap,
        "[daq]": machine.daq,
        "[mode]": machine.mode,
        "[limits]": machine.limits,
        "[speed]": machine.speed,
        "[doubt]": machine.doubt,
    }
    for place, table in tables.items():
        yield from check_ranges(table, place)
    for i, channel in enumerate(machine.daq.channel, 1):
        yield from check_ranges(channel, f"[[daq.channel]] {i}")
    yield from check_drive(machine.drive, machine.speed)


def _check_program(machine: MachineTables, program: ProgramTable) -> Iterator[ImplausibleSetting]:
    yield from _check_machine(machine)
    place = f"program {program.name!r}"
    yield from _check_cut_and_material(machine, program, place)
    if program in machine.program:  # of a cut that is only asked about, its geometry was just said
        same_tool = {f"program {other.name!r}": other for other in machine.program if other.tool == program.tool}
        yield from (doubted for doubted in check_same_tool(same_tool) if doubted.location == place)
    for tool in machine.tool:
        if tool.name == program.tool:
            yield from check_tool(tool, f"tool {tool.name!r}")
            yield from check_program_tool(program, tool, place)
    if program.tool == machine.tap.tool:
        yield from check_stick_out(machine.tap, {place: program})


def _check_cut_and_material(machine: MachineTables, cut: CutTable, place: str) -> Iterator[ImplausibleSetting]:
    yield from check_cut(cut, place)
    for material in machine.material:
        if cut.material is not None and fold_material_name(material.name) == fold_material_name(cut.material):
            yield from check_material(material, f"material {material.name!r}")


def _check_model(machine: MachineTables, program: ProgramTable) -> Iterator[ImplausibleSetting]:
    if machine.spindle is not None:
        yield from check_spindle(machine.spindle)
    for tool in machine.tool:
        if tool.name == program.tool:
            yield from check_tool_shape(tool, f"tool {tool.name!r}")
