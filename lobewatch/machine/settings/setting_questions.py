"""What a machine.toml is asked about before a word is said of a program, and which of it was accepted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from lobes import folded_name
from lobewatch.machine.settings.cut_tables import CutTable, Drive, MaterialTable, ProgramTable
from lobewatch.machine.settings.daq_tables import Daq
from lobewatch.machine.settings.doubt_table import DoubtTable
from lobewatch.machine.settings.plausible import (
    TEMPLATE_BEARINGS,
    Doubted,
    about_alike,
    about_cut,
    about_drive,
    about_its_tool,
    about_material,
    about_shape,
    about_spindle,
    about_stick_out,
    about_tool,
    out_of_range,
)
from lobewatch.machine.settings.setup_tables import Identity, Limits, ModeChoice, SpeedRange, TapSetup
from lobewatch.machine.settings.spindle_tables import SpindleTable
from lobewatch.machine.settings.tool_table import ToolTable


class AskedMachine(Protocol):
    """The tables of machine.toml, as `Machine` has them."""

    @property
    def machine(self) -> Identity: ...  # noqa: D102
    @property
    def tap(self) -> TapSetup: ...  # noqa: D102
    @property
    def daq(self) -> Daq: ...  # noqa: D102
    @property
    def mode(self) -> ModeChoice: ...  # noqa: D102
    @property
    def limits(self) -> Limits: ...  # noqa: D102
    @property
    def speed(self) -> SpeedRange: ...  # noqa: D102
    @property
    def drive(self) -> Drive: ...  # noqa: D102
    @property
    def doubt(self) -> DoubtTable: ...  # noqa: D102
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


def questions_of_program(machine: AskedMachine, program: ProgramTable, on_model: bool) -> list[Doubted]:
    """Open questions that the word on a program waits for; on_model: whether that rests on [spindle], too."""
    return _open(machine, [*_about_program(machine, program), *(_about_model(machine, program) if on_model else ())])


def all_questions(machine: AskedMachine) -> list[Doubted]:
    """All open questions of a machine.toml."""
    asked = [*_about_machine(machine)]
    for program in machine.program:
        asked += _about_program(machine, program)
        asked += _about_model(machine, program)
    if machine.spindle is not None:
        asked += about_spindle(machine.spindle)
    if machine.reference_cut is not None:
        asked += _about_cut(machine, machine.reference_cut, "[reference_cut]")
    return _open(machine, asked)


def guessed_bearings(machine: AskedMachine) -> Doubted | None:
    """Question about a bearing stiffness that nobody has given; None where somebody has, or has accepted it."""
    spindle = machine.spindle
    if spindle is None or spindle.bearing_stiffness_n_per_um != TEMPLATE_BEARINGS:
        return None
    why = "is what a new machine.toml holds, and no tap test has found it yet: all of the model rests on it"
    key = "bearing_stiffness_n_per_um"
    asked = Doubted("setting-guessed", "[spindle]", key, f"{TEMPLATE_BEARINGS:g}", why)
    return next(iter(_open(machine, [asked])), None)


def _open(machine: AskedMachine, asked: list[Doubted]) -> list[Doubted]:
    """Each question once, without those that a person has answered."""
    by_claim = {doubted.claim: doubted for doubted in asked}
    return [doubted for claim, doubted in by_claim.items() if claim not in machine.machine.accepted]


def _about_machine(machine: AskedMachine) -> Iterator[Doubted]:
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
        yield from out_of_range(table, place)
    for i, channel in enumerate(machine.daq.channel, 1):
        yield from out_of_range(channel, f"[[daq.channel]] {i}")
    yield from about_drive(machine.drive, machine.speed)


def _about_program(machine: AskedMachine, program: ProgramTable) -> Iterator[Doubted]:
    yield from _about_machine(machine)
    place = f"program {program.name!r}"
    yield from _about_cut(machine, program, place)
    if program in machine.program:  # of a cut that is only asked about, its geometry was just said
        same_tool = {f"program {other.name!r}": other for other in machine.program if other.tool == program.tool}
        yield from (doubted for doubted in about_alike(same_tool) if doubted.place == place)
    for tool in machine.tool:
        if tool.name == program.tool:
            yield from about_tool(tool, f"tool {tool.name!r}")
            yield from about_its_tool(program, tool, place)
    if program.tool == machine.tap.tool:
        yield from about_stick_out(machine.tap, {place: program})


def _about_cut(machine: AskedMachine, cut: CutTable, place: str) -> Iterator[Doubted]:
    yield from about_cut(cut, place)
    for material in machine.material:
        if cut.material is not None and folded_name(material.name) == folded_name(cut.material):
            yield from about_material(material, f"material {material.name!r}")


def _about_model(machine: AskedMachine, program: ProgramTable) -> Iterator[Doubted]:
    if machine.spindle is not None:
        yield from about_spindle(machine.spindle)
    for tool in machine.tool:
        if tool.name == program.tool:
            yield from about_shape(tool, f"tool {tool.name!r}")
