"""Machine file machine.toml: all tables, in the units of the shop."""

import hashlib
import math
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import msgspec

from acquisition import DataError
from acquisition.errors import join_sentences
from dsm import Spindle, change_tool
from lobes import Cut, CuttingCoefficients, explain_unknown_material, fold_material_name, materials_by_name
from lobewatch.machine.settings import cut_tables as cutting
from lobewatch.machine.settings import toml
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.notify_table import NotifyTable
from lobewatch.machine.settings.setup_tables import DaqTable, LimitsTable, MachineTable, ModeTable, SpeedTable, TapTable
from lobewatch.machine.settings.spindle_tables import SpindleTable, ToolTable
from lobewatch.machine.settings.unit_text import convert_unit_texts

REFERENCE_CUT = "reference cut"
"""Name of [reference_cut] among the names of programs."""
USER_SOURCE = "machine.toml"
"""Source of cutting coefficients that a person has entered."""


class Machine(toml.TomlTable, frozen=True):
    """All tables of machine.toml.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> program = machine.program[0]
    >>> cut = machine.build_cut(program)  # in SI units
    >>> cut.teeth, f"Kt {cut.tangential / 1e6:.0f} N/mm2"
    (4, 'Kt 1400 N/mm2')
    >>> machine.model(program.tool).bearings[0].position  # m
    0.166
    """

    machine: MachineTable
    """Identity of the machine: [machine]."""
    tap: TapTable = TapTable()
    """Setup of the tap test: [tap]."""
    daq: DaqTable = DaqTable()
    """DAQ and its sensors: [daq]."""
    mode: ModeTable = ModeTable()
    """Choice of the followed mode: [mode]."""
    limits: LimitsTable = LimitsTable()
    """Frequency drops that warn and alarm: [limits]."""
    speed: SpeedTable = SpeedTable()
    """Speed range of the lobe diagrams: [speed]."""
    drive: cutting.DriveTable = cutting.DriveTable()
    """Power and torque of the spindle motor: [drive]."""
    doubt: cutting.UncertaintyTable = cutting.UncertaintyTable()
    """Uncertainty of the inputs: [doubt]."""
    notify: NotifyTable = NotifyTable()
    """Broker for alarms: [notify]."""
    material: tuple[cutting.MaterialTable, ...] = ()
    """Materials of the shop: each [[material]]."""
    reference_cut: CutTable | None = None
    """Cut for comparison over the years: [reference_cut]."""
    all_programs: tuple[ProgramTable, ...] = msgspec.field(default=(), name="program")
    """All [[program]] tables, those without a speed or depth included."""
    spindle: SpindleTable | None = None
    """Spindle model: [spindle]; None without one."""
    tool: tuple[ToolTable, ...] = ()
    """Tools: each [[tool]]."""

    def __post_init__(self) -> None:
        self._check_tools()
        self._check_hammer()
        names, low, high = [program.name for program in self.all_programs], self.speed.low_rpm, self.speed.high_rpm
        for i, program in enumerate(self.all_programs, 1):
            if program.name in (*names[: i - 1], REFERENCE_CUT):
                raise ValueError(f"program {i}: duplicate name {program.name!r}. Program names must be unique.")
            if not (math.isnan(program.speed_rpm) or low <= program.speed_rpm <= high):
                speed = f"speed_rpm={program.speed_rpm:g}"
                raise ValueError(f"program {i}: {speed} is outside [speed] {low:g}..{high:g} rpm")
        names = [material.name for material in self.material]
        for i, name in enumerate(names, 1):
            if fold_material_name(name) in map(fold_material_name, names[: i - 1]):
                raise ValueError(f"material {i}: duplicate name {name!r}. Material names must be unique.")
        if self.reference_cut:
            self.coefficients(self.reference_cut)
        for i, program in enumerate(self.all_programs, 1):
            self.coefficients(program)
            self._check_tool_of(f"program {i}", program)

    @property
    def program(self) -> tuple[ProgramTable, ...]:
        """Programs with speed and depth."""
        return tuple(program for program in self.all_programs if not program.is_incomplete)

    def coefficients(self, table: CutTable) -> CuttingCoefficients:
        """Return the cutting coefficients of a cut: its own, else those of its material.

        Any name of a material is valid, in any case and with any blanks. A [[material]] takes precedence.

        Parameters
        ----------
        table
            Cut or program.

        Raises
        ------
        ValueError
            If the material is unknown.
        """
        tangential, radial = (1e6 * (k or 0) for k in (table.tangential_n_per_mm2, table.radial_n_per_mm2))
        if table.material is None:
            return CuttingCoefficients("", tangential, radial, source=USER_SOURCE)
        own = {fold_material_name(material.name): material.build() for material in self.material}
        by_name, name = {**materials_by_name(), **own}, fold_material_name(table.material)
        if name not in by_name:
            cure = "List all names with lobes.materials_by_name, or add a [[material]]."
            near = explain_unknown_material(table.material, by_name)
            raise ValueError(f"unknown material {table.material!r}. {near} {cure}")
        known = by_name[name]
        if table.tangential_n_per_mm2 is None:
            return known
        unpublished: dict[str, Any] = {"tangential_range": None, "ratio_range": None, "specific_forces": ()}
        return replace(known, tangential=tangential, radial=radial, source=USER_SOURCE, **unpublished)

    def build_cut(self, table: CutTable) -> Cut:
        """Build a cut in SI units at its largest radial depth on a straight path, feed along x.

        Parameters
        ----------
        table
            Cut or program.
        """
        coefficients, diameter = self.coefficients(table), table.tool_diameter_mm / 1e3
        lag = 2 * math.tan(math.radians(self.helix_deg(table) or 0.0)) / diameter
        pitch = cutting.convert_pitch(self.pitch_deg(table), table.teeth)
        shape, pressures = (table.teeth, table.immersion), (coefficients.tangential, coefficients.radial)
        damping = self.process_damping(table)[0] / diameter
        return Cut(*shape, table.direction, *pressures, helix_lag=lag, pitch=pitch, process_damping=damping)

    def process_damping(self, table: CutTable) -> tuple[float, float]:
        """Return the lowest and highest process damping coefficient C of a cut (N/m); (0, inf) if unknown.

        Parameters
        ----------
        table
            Cut or program.
        """
        name = fold_material_name(table.material or "")
        own = {fold_material_name(material.name): material.process_damping_n_per_m for material in self.material}
        low, high = table.process_damping_n_per_m or own.get(name) or (0.0, math.inf)
        return low, high

    def engaged_cuts(self, table: CutTable) -> tuple[Cut, ...]:
        """Return a cut at each radial depth along its path, feed along x.

        Parameters
        ----------
        table
            Cut or program.
        """
        cut = self.build_cut(table)
        return tuple(replace(cut, immersion=immersion) for immersion in table.immersions)

    def helix_deg(self, table: CutTable) -> float | None:
        """Return the helix angle of a cut or its [[tool]] (deg); None if unknown.

        Parameters
        ----------
        table
            Cut or program.
        """
        tool = self.find_tool(table)
        return tool.helix_deg if table.helix_deg is None and tool else table.helix_deg

    def pitch_deg(self, table: CutTable) -> Sequence[float] | None:
        """Return the pitch angles of a cut or its [[tool]] (deg); None for equal pitch.

        Parameters
        ----------
        table
            Cut or program.
        """
        tool = self.find_tool(table)
        return tool.pitch_deg if table.pitch_deg is None and tool else table.pitch_deg

    def find_tool(self, table: CutTable) -> ToolTable | None:
        """Return the [[tool]] of a program; None without one, and for the reference cut.

        Parameters
        ----------
        table
            Cut or program.
        """
        return self.tool_table(table.tool) if isinstance(table, ProgramTable) else None

    def tool_table(self, name: str) -> ToolTable | None:
        """Return the [[tool]] of a name; None without one.

        Parameters
        ----------
        name
            Name of the tool.
        """
        return next((tool for tool in self.tool if tool.name == name), None)

    def _check_tool_of(self, place: str, program: ProgramTable) -> None:
        """Reject a [[tool]] whose pitches or flutes do not fit its program."""
        tool = self.find_tool(program)
        if tool is None:
            return
        try:
            cutting.convert_pitch(self.pitch_deg(program), program.teeth)
        except ValueError as error:
            raise ValueError(f"{place}, pitch_deg of tool {tool.name!r}: {error}") from error
        if tool.flute_length_mm is not None and program.depth_mm > tool.flute_length_mm:
            flutes = f"flute_length_mm={tool.flute_length_mm:g} of tool {tool.name!r}"
            raise ValueError(f"{place}: depth_mm={program.depth_mm:g} is deeper than {flutes}")

    def _check_hammer(self) -> None:
        if self.tap.hammer == "force" and {channel.quantity for channel in self.daq.channel} == {"acceleration"}:
            cure = 'Add the channel of the hammer, or set hammer = "none" in [tap].'
            raise ValueError(f"daq: no [[daq.channel]] measures force. {cure}")

    def _check_tools(self) -> None:
        names = [tool.name for tool in self.tool]
        for i, tool in enumerate(self.tool, 1):
            if tool.name in names[: i - 1]:
                raise ValueError(f"tool {i}: duplicate name {tool.name!r}. Tool names must be unique.")
            if not tool.segments:
                continue
            if tool.name == self.tap.tool:
                problem = f"[spindle] already has the segments of {tool.name!r}, the tool of [tap]"
                raise ValueError(f"tool {i}: {problem}. Remove the segments from this [[tool]], or rename it.")
            if self.spindle is None or self.spindle.tool_length_mm is None:
                cure = f"Give the length of {self.tap.tool!r} on the shaft."
                raise ValueError(f"tool {i}: tool_length_mm is missing in [spindle]. {cure}")
            try:
                self.model(tool.name)
            except ValueError as error:
                raise ValueError(f"tool {i}, in SI units: {error}") from error
        length = self.spindle.build().length * 1e3 if self.spindle else math.inf
        if self.tap.position_mm > length:
            raise ValueError(f"tap: position_mm={self.tap.position_mm:g} is outside the shaft, 0 to {length:g} mm")

    def model(self, tool: str) -> Spindle:
        """Build the spindle model with a tool, in SI units.

        Parameters
        ----------
        tool
            Name of the tool.

        Raises
        ------
        DataError
            Without [spindle], or without a shape of the tool.
        """
        if self.spindle is None:
            raise DataError("no spindle model. Add a [spindle] table, as in make_machine_folder.template.")
        spindle = self.spindle.build()
        if tool == self.tap.tool:
            return spindle
        free_tool = self.find_modelled_tool(tool).build(spindle)
        return change_tool(spindle, (self.spindle.tool_length_mm or 0.0) / 1e3, free_tool)

    @property
    def modelled_tools(self) -> list[ToolTable]:
        """Tools that have a shape for the spindle model."""
        return [tool for tool in self.tool if tool.segments]

    def find_modelled_tool(self, name: str) -> ToolTable:
        """Return the [[tool]] of a name that has a shape; DataError without one.

        Parameters
        ----------
        name
            Name of the tool.
        """
        for tool in self.modelled_tools:
            if tool.name == name:
                return tool
        names = ", ".join(map(repr, [self.tap.tool, *(tool.name for tool in self.modelled_tools)]))
        raise DataError(f"tool {name!r} has no model. Choose {names}, or add a [[tool]] table with its segments.")

    def cuts(self, tool: str) -> dict[str, tuple[Cut, ...]]:
        """Return the reference cut and the programs of a tool by name, for each feed direction and engagement.

        Parameters
        ----------
        tool
            Name of the tool.
        """
        cuts = {}
        for name, table in self.cut_tables.items():
            if not isinstance(table, ProgramTable) or table.tool == tool:
                directed = product(self.engaged_cuts(table), table.feed_axes)
                cuts[name] = tuple(replace(cut, feed_angle=cutting.FEED_ANGLES[axis]) for cut, axis in directed)
        return cuts

    @property
    def cut_tables(self) -> dict[str, CutTable]:
        """Reference cut and all programs by name."""
        tables = {REFERENCE_CUT: self.reference_cut} if self.reference_cut else {}
        return tables | {program.name: program for program in self.program}

    def _tool_body(self, tool: ToolTable) -> tuple[Any, ...] | None:
        """Return the values behind the compliance of a tool, its own or those of all of its programs; None if unknown.

        The same as of `find_tool_properties`, so that a further program of the tool changes nothing.
        """
        stick_out = self.tap.conditions(tool.name).stick_out_mm or tool.stick_out_mm
        programs = [cut for cut in self.all_programs if cut.tool == tool.name]
        diameter = tool.diameter_mm or _common_value(cut.tool_diameter_mm for cut in programs)
        if None in (stick_out, tool.tool_material, diameter):
            return None
        flutes = tool.flute_length_mm or _common_value(cut.flute_length_mm for cut in programs)
        return tool.name, tool.tool_material, diameter, flutes, stick_out, tool.shank_diameter_mm

    @property
    def settings_hash(self) -> str:
        """SHA-256 of all settings that decide the results of a tap test, except verdicts."""
        tools = [(tool.name, tool.segments, tool.masses) for tool in self.modelled_tools]
        tap = self.tap.tool, self.tap.position_mm, self.tap.sensor
        bodies = [*filter(None, map(self._tool_body, self.tool))]
        settings = ("questions, K against the model", self.mode, self.spindle, tools, *tap, *bodies)
        return hashlib.sha256(msgspec.json.encode(settings)).hexdigest()


def _common_value(values: Iterable[float | None]) -> float | None:
    """Return the value that all have in common; None without one."""
    same = set(values)
    return same.pop() if len(same) == 1 else None


def read_machine_file(path: Path) -> Machine:
    """Read a machine file; DataError with the place of a fault, OSError if it cannot be read."""
    return parse_machine_file(toml.read_toml_text(path), str(path))


def parse_machine_file(text: str, name: str = "machine.toml") -> Machine:
    """Parse the text of a machine file; DataError with the place of a fault."""
    tables: dict[str, Any] = {}
    try:
        tables = toml.parse_toml_tables(text)
        toml.check_control_characters(tables)
        return msgspec.convert(convert_unit_texts(tables), Machine)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{name}: {join_sentences(str(error), toml.suggest_plain_number(text))}") from error
    except msgspec.ValidationError as error:
        raise DataError(f"{name}: {toml.explain_validation_error(str(error), tables, Machine)}") from error
    except (ValueError, ArithmeticError, RecursionError) as error:
        raise DataError(f"{name}: {error}") from error
