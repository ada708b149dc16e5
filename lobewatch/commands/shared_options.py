"""Options shared by several commands: facts about a file, edited modes, cuts and numbers."""

import contextlib
import functools
import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, Literal

from typer import Argument, BadParameter, Context, Option

import acquisition
from lobewatch.machine.folder_files import to_folder_path
from lobewatch.machine.settings.display_units import read_units, reads_inches, shown_units
from lobewatch.machine.settings.number_text import format_number, list_readings, read_number, read_numbers
from lobewatch.show.terminal.output import notes


def find_recording(path: Path | None) -> Path:
    """Return the path of a machine folder or a recording; ValueError if it does not exist."""
    if path is None:
        raise ValueError("no machine folder or recording. Name one of them, or use --page.")
    if not path.exists():
        raise ValueError(f"{path}: no such file or folder. Name a machine folder or a recorded cut.")
    return path


def number(text: str | float) -> float:
    """Parse a number with a decimal point, and with separators between thousands if it has no other value.

    The error for a comma shows the possible values.
    """
    try:
        return float(text)
    except ValueError:
        readings = list_readings(str(text))
        if len(readings) == 1 and read_number(str(text).strip(), ".") is not None:
            return readings[0]
        hint = f". Write {' or '.join(map(format_number, readings))}." if readings else ""
        raise BadParameter(f"{text!r} is not a number{hint}") from None


def length(text: str | float) -> float:
    """Parse a length (mm), also with a unit: 12.5, 0.5in, 1/2"."""
    return _quantity(text, "_mm")


def feed(text: str | float) -> float:
    """Parse a feed per tooth (mm), also with a unit: 0.05, 0.002 ipt."""
    return _quantity(text, "feed_per_tooth_mm")


def power(text: str | float) -> float:
    """Parse a power (kW), also with a unit: 1.4, 1400 W, 2 hp."""
    return _quantity(text, "_kw")


def _quantity(text: str | float, kind: str) -> float:
    text = str(text).strip()
    is_inch, is_fraction = reads_inches() and kind != "_kw", re.fullmatch(r"(?:\d+[ -])?\d+/\d+", text)
    if is_fraction and not is_inch:
        raise BadParameter(f"{text!r} has no unit. Write {text}in for inches.")
    if is_inch and (is_fraction or re.fullmatch(r"[\d.,eE+-]+", text)):
        text = f"{text}in" if is_fraction else f"{number(text):.12g}in"
        notes.print(f"read as {text}", markup=False)
    if not re.search(r"\d\D*[^\W\d_\"]|\"", text) or re.fullmatch(r"[\d.]+[eE][+-]?\d+", text):
        return number(text)
    from lobewatch.machine.settings.unit_text import UNITS_BY_KEY_END, read_quantity

    try:
        return read_quantity(text, UNITS_BY_KEY_END[kind])
    except ValueError as error:
        raise BadParameter(str(error)) from None


def rpm(text: str | float) -> float:
    """Parse a spindle speed, whose point before three digits may separate thousands; with or without the unit rpm."""
    text = re.sub(r"\s*(?:rpm|1/min)\s*$", "", str(text), flags=re.IGNORECASE)
    if text.casefold().endswith(("sfm", "sfpm", "ft/min", "m/min")):
        raise BadParameter(f"{text!r} is a cutting speed. Give the spindle speed in rpm.")
    if len(list_readings(str(text))) < 2:
        return number(text)
    from lobewatch.machine.settings.setup_tables import SpeedTable
    from lobewatch.machine.settings.toml import find_plausible_ranges

    ranges = find_plausible_ranges(SpeedTable)
    try:
        return read_numbers([str(text).strip()], [(ranges["low_rpm"].low, ranges["high_rpm"].high)])[0]
    except ValueError as error:
        raise BadParameter(str(error)) from None


def parse_speeds(text: str) -> tuple[float, float]:
    """Parse the option --speeds: lowest and highest spindle speed (rpm)."""
    from lobewatch.machine.settings.speed_range import parse_speed_range

    try:
        return parse_speed_range(text)
    except ValueError as error:
        raise ValueError(f"--speeds {error}") from None


def mass(text: str | float) -> float:
    """Parse a mass of the check with a known mass (kg), within its limits."""
    from lobewatch.tap.mass_check import read_mass

    try:
        return read_mass(str(text))
    except ValueError as error:
        raise BadParameter(str(error)) from None


DATE_EXAMPLES = "2026-11-27, 2026-11-27T08:30 or 2026-11-27T08:30Z"
"""Forms of a date."""
FIRST_NOW, LAST_NOW = (datetime(year, 1, 1, tzinfo=UTC) for year in (1970, 2200))
"""Range of dates that ages may be counted to; chosen, as no clock of a computer is beyond it."""


def present_time(text: str) -> datetime:
    """Parse a date or time (ISO 8601); local time without a time zone."""
    with contextlib.suppress(ValueError, OverflowError):
        time = datetime.fromisoformat(text)
        if FIRST_NOW <= (time if time.tzinfo else time.replace(tzinfo=UTC)) < LAST_NOW:
            return time.astimezone()
    dates = f"{FIRST_NOW:%Y-%m-%d} to {LAST_NOW - timedelta(days=1):%Y-%m-%d}"
    raise BadParameter(f"{text!r} is not a date from {dates}. Write {DATE_EXAMPLES}.")


def local_time(text: str) -> datetime:
    """Parse a date or time (ISO 8601) to local time without a time zone."""
    with contextlib.suppress(ValueError, OverflowError):
        time = datetime.fromisoformat(text)
        return time if time.tzinfo is None else time.astimezone().replace(tzinfo=None)
    raise BadParameter(f"{text!r} is not a date. Write {DATE_EXAMPLES}.")


Command = Callable[..., None]


def _use_units(ctx: Context, folder: Path | None) -> Path | None:
    """Read and show lengths in the units of the machine from here on."""
    if folder is not None:
        ctx.with_resource(shown_units(read_units(folder)))
    return folder


FolderArgument = functools.partial(Argument, parser=to_folder_path, callback=_use_units, is_eager=True)
WearScenarioName = Literal["steady", "step", "accelerating", "replaced", "none"]
Machine = Annotated[Path, FolderArgument(help="Machine folder.")]
TappedMachine = Annotated[Path, FolderArgument(help="Machine folder with at least one tap test.")]
SpindleMachine = Annotated[Path, FolderArgument(help="Machine folder with [spindle] in machine.toml.")]
FleetFolder = Annotated[Path, FolderArgument(help="Machine folder, or a folder of machine folders.")]
ExcludableEntry = Annotated[
    str, Argument(help="Tap test (ID, file name or a unique part of the ID), test cut (c1) or mass check (m1).")
]
AsCsv = Annotated[bool, Option("--csv", help="CSV on stdout.")]
Diameter = Annotated[float | None, Option(parser=length, help="Tool diameter (mm).")]
RadialDepth = Annotated[float | None, Option(parser=length, help="Radial depth of cut ae (mm). Default: full slot.")]
AxialDepth = Annotated[float | None, Option(parser=length, help="Axial depth of cut ap (mm).")]
OtherCutSpeed = Annotated[
    float | None, Option(parser=rpm, help="Spindle speed (rpm) of a cut that is not in machine.toml.")
]
MillingDirection = Annotated[Literal["up", "down"] | None, Option(help="Up or down milling.")]
CutDepth = Annotated[float | None, Option(parser=length, help="Axial depth of cut ap (mm). Default: from the program.")]
Now = Annotated[
    datetime | None,
    Option(
        parser=present_time,
        metavar="DATE",
        help="Date that the age of tap tests is counted to, for tests and scripts (local time). Default: now.",
    ),
]
LocalTime = functools.partial(Option, parser=local_time, metavar="DATE")
CutDate = Annotated[datetime | None, LocalTime(help="Date of the cut (local time). Default: now.")]
Seed = Annotated[int, Option(help="Seed of the random numbers.")]
ReclampingScatter = Annotated[float, Option(help="Reclamping repeatability of f1: standard deviation (%), 0 to 5.")]
Material = Annotated[str | None, Option(help="Material in machine.toml or lobewatch materials.")]
Flutes = Annotated[int | None, Option(help="Number of flutes.")]
CutPower = Annotated[
    float | None,
    Option(
        parser=power, help="Cutting power (kW): drive display in the cut minus drive display in air at the same speed."
    ),
]
AddedModes = Annotated[list[str] | None, Option(help="Fit another mode near this frequency (Hz), repeatable.")]
DroppedModes = Annotated[list[str] | None, Option(help="Leave out the mode at this frequency (Hz), repeatable.")]
FixedModes = Annotated[
    list[str] | None, Option(help="Hold a mode at Hz:zeta, such as 1500:0.03, and fit only its stiffness K.")
]
AcceptedHits = Annotated[
    list[str] | None, Option(help="Accept a rejected hit despite this fault, N:CODE (3:double-hit), repeatable.")
]
RejectedHits = Annotated[list[int] | None, Option(help="Reject an accepted hit by its number, repeatable.")]


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """Options on a recorded file, in the order of the help page."""

    columns: Annotated[
        str,
        Option(help='Column headings: "frequency,real,imag", "time [s],force [N]", "frequency=F,frf=H:2".'),
    ] = ""
    """Headings of the columns, separated by commas."""
    quantity: Annotated[str, Option(help="Response: displacement, velocity or acceleration.")] = ""
    """Quantity of the response."""
    unit: Annotated[str, Option(help="Unit of response (m/s^2, g) or FRF (m/N, g/N).")] = ""
    """Unit of the response or of the FRF."""
    force_unit: Annotated[str, Option(help="Force unit (N, lbf).")] = ""
    """Unit of the force."""
    skip: Annotated[int | None, Option(min=1, help="Number of text lines above the numbers.")] = None
    """Number of lines above the rows."""
    decimal: Annotated[str, Option(help="Decimal sign: comma or point.")] = ""
    """Decimal sign."""
    spacing: Annotated[float | None, Option(help="Line spacing (Hz) of an FRF without frequencies.")] = None
    """Spacing of the lines (Hz)."""
    start: Annotated[float | None, Option(help="First frequency (Hz) of an FRF without frequencies. Default: 0.")] = (
        None
    )
    """Frequency of the first line (Hz)."""
    force: Annotated[Path | None, Option(help="File with the force.")] = None
    """File of the force."""
    rate: Annotated[float | None, Option(help="Sample rate (Hz).")] = None
    """Sample rate (Hz)."""
    averages: Annotated[int | None, Option(help="Averaged hits of an FRF. Default: 1.")] = None
    """Number of hits that an FRF was averaged from."""
    response: Annotated[int | None, Option(help="Number of the response in the file, counted from 1.")] = None
    """Number of the response, from 1."""
    one_test: Annotated[
        bool,
        Option("--one-test", help="Hits of one tap test: all files, groups, numbered channels, rows of arrays."),
    ] = False
    """True if all files, groups and numbered channels are hits of one tap test."""
    axes: Annotated[str, Option(help='Axes of the arrays: "hits,channels,samples" in any order.')] = ""
    """Axes of the arrays, separated by commas."""
    full_scale: Annotated[str, Option(help='Full scale of each channel of a sound file: "500,50".')] = ""
    """Full scales of the channels, separated by commas."""
    sensitivity: Annotated[str, Option(help='Sensitivity of each channel: "2.25 mV/N,10.2 mV/g".')] = ""
    """Sensitivities of the channels, separated by commas."""

    def description(self, **fields: Any) -> "acquisition.Description":
        """Make the description of a file. ValueError for an invalid full scale."""
        try:
            scales = tuple(float(word) for word in self.full_scale.split(",")) if self.full_scale else ()
        except ValueError as error:
            text = f'--full-scale {self.full_scale} is not a list of numbers. Give a number per channel: "500,50".'
            raise ValueError(text) from error
        names = ("columns", "sensitivity", "axes")
        lists = {name: _split_words(getattr(self, name)) for name in names}
        return acquisition.Description(**vars(self) | lists | {"full_scale": scales} | fields)


def add_file_options(*, without: Iterable[str] = ()) -> Callable[[Command], Command]:
    """Replace the parameter `file_options: FileOptions` of a command by single options, except for some."""
    options = inspect.signature(FileOptions, eval_str=True).parameters
    shared = {name: option for name, option in options.items() if name not in without}

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def run(**values: Any) -> None:
            command(file_options=FileOptions(**{name: values.pop(name) for name in shared}), **values)

        parameters: list[inspect.Parameter] = []
        for name, parameter in inspect.signature(command, eval_str=True).parameters.items():
            keyword = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            parameters += shared.values() if name == "file_options" else [keyword]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        return run

    return decorate


GENERAL_OPTIONS = ("as_json", "quiet", "verbose")
"""Names of the options that apply to all uses of a command."""


def reject_options(ctx: Context, names: Iterable[str], problem: str) -> None:
    """Raise ValueError for the first of these options and arguments that is on the command line."""
    rejected = set(names)
    for parameter in ctx.command.params:
        source = ctx.get_parameter_source(str(parameter.name))
        if parameter.name in rejected and source is not None and source.name == "COMMANDLINE":
            label = max(parameter.opts, key=len)
            given = label if label.startswith("-") else label.upper()
            raise ValueError(f"{given} {problem}. Leave out {given}.")


def allow_options(ctx: Context, names: Iterable[str], problem: str) -> None:
    """Raise ValueError for any other option that is on the command line, except for `GENERAL_OPTIONS`."""
    reject_options(ctx, {str(each.name) for each in ctx.command.params}.difference(names, GENERAL_OPTIONS), problem)


def join_hit_files(
    paths: list[Path], description: "acquisition.Description"
) -> tuple[list[Path], "acquisition.Description"]:
    """Return the first file and the description with all others if they are one tap test; else both unchanged."""
    if not description.one_test or len(paths) < 2:
        return paths, description
    return paths[:1], replace(description, hit_files=tuple(paths[1:]))


def _split_words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",")) if text else ()


def cut_fields(*values: object) -> dict[str, Any]:
    """Collect speed, depth, tool, material, teeth, diameter, radial depth and direction as fields of a [[program]]."""
    names = ("speed_rpm", "depth_mm", "tool", "material", "teeth", "tool_diameter_mm", "radial_depth_mm", "direction")
    return dict(zip(names, values, strict=True))
