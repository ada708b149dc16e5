"""Options shared by several commands: facts about a file, edited modes, cuts and numbers."""

import functools
import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from typer import Argument, BadParameter, Option

import acquisition
from lobewatch.machine.folder_files import to_folder_path


def number(text: str | float) -> float:
    """Parse a number. The error for a decimal comma shows the number with a point."""
    try:
        return float(text)
    except ValueError:
        comma = re.fullmatch(r"\s*([+-]?\d+),(\d+)\s*", str(text))
        hint = f"; write {comma[1]}.{comma[2]} with a point" if comma else ""
        raise BadParameter(f"{text!r} is no number{hint}") from None


Command = Callable[..., None]
FolderArgument = functools.partial(Argument, parser=to_folder_path)
WearScenarioName = Literal["steady", "step", "accelerating", "replaced", "none"]
Machine = Annotated[Path, FolderArgument(help="Machine folder.")]
TappedMachine = Annotated[Path, FolderArgument(help="Machine folder with at least one tap test.")]
SpindleMachine = Annotated[Path, FolderArgument(help="Machine folder with a [spindle] in its machine.toml.")]
FleetFolder = Annotated[Path, FolderArgument(help="Machine folder, or a folder of machine folders.")]
ExcludableEntry = Annotated[
    str, Argument(help="The tap test: its identity, its file, or a part that no other has; or a test cut, c1.")
]
AsCsv = Annotated[bool, Option("--csv", help="A table with commas on stdout instead of text.")]
Diameter = Annotated[float | None, Option(parser=number, help="Diameter of the tool, mm.")]
MillingDirection = Annotated[Literal["up", "down"] | None, Option(help="Up or down milling.")]
CutDepth = Annotated[float | None, Option(help="Axial depth, mm; that of the program where not given.")]
CutDate = Annotated[datetime | None, Option(help="When it was cut, local time; now where not given.")]
Seed = Annotated[int, Option(help="Of the random numbers.")]
ReclampingScatter = Annotated[float, Option(help="Scatter of f_1 by remounting: standard deviation, 0 to 5 %.")]
Material = Annotated[str | None, Option(help="A [[material]], or one of lobewatch materials.")]
Flutes = Annotated[int | None, Option(help="Teeth of the tool.")]
CutPower = Annotated[
    float | None,
    Option(help="Power of the cut, kW: what the drive shows, less what it shows in air at the same speed."),
]
AddedModes = Annotated[list[str] | None, Option(help="Fit a further mode near this frequency (Hz); may be repeated.")]
DroppedModes = Annotated[list[str] | None, Option(help="Leave out the mode at this frequency (Hz); may be repeated.")]
FixedModes = Annotated[list[str] | None, Option(help="Hold a mode at Hz:zeta, as in 1500:0.03, and fit its K alone.")]


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """Options on a recorded file, in the order of the help page."""

    columns: Annotated[
        str,
        Option(
            help='Of its columns: "frequency,real,imag", "time [s],force [N],acceleration [g]", "frequency=F,frf=H:2".'
        ),
    ] = ""
    """Headings of the columns, separated by commas."""
    quantity: Annotated[str, Option(help="Of the response: displacement, velocity or acceleration.")] = ""
    """Quantity of the response."""
    unit: Annotated[str, Option(help="Of the response (m/s^2, g), or of an FRF (m/N, um/N, g/N).")] = ""
    """Unit of the response or of the FRF."""
    force_unit: Annotated[str, Option(help="Of the force (N, lbf).")] = ""
    """Unit of the force."""
    skip: Annotated[int | None, Option(min=1, help="Lines of a text that are passed over above its rows.")] = None
    """Number of lines above the rows."""
    decimal: Annotated[
        str, Option(help="Decimal sign of a text where its numbers leave that in doubt: comma or point.")
    ] = ""
    """Decimal sign."""
    spacing: Annotated[
        float | None, Option(help="Hz from line to line of an FRF that the file holds without its frequencies.")
    ] = None
    """Spacing of the lines (Hz)."""
    start: Annotated[float | None, Option(help="Hz of the first of these lines; 0 where not given.")] = None
    """Frequency of the first line (Hz)."""
    force: Annotated[Path | None, Option(help="File that holds the force, where FILE holds only the response.")] = None
    """File of the force."""
    rate: Annotated[float | None, Option(help="Samples a second (Hz).")] = None
    """Sample rate (Hz)."""
    averages: Annotated[int | None, Option(help="Hits that an FRF was averaged from; 1 where nobody says.")] = None
    """Number of hits that an FRF was averaged from."""
    response: Annotated[int | None, Option(help="Which of several responses, from 1.")] = None
    """Number of the response, from 1."""
    full_scale: Annotated[str, Option(help='Of each channel of a sound file, in its unit: "500,50".')] = ""
    """Full scales of the channels, separated by commas."""
    sensitivity: Annotated[str, Option(help='Of each channel in volts: "2.25 mV/N,10.2 mV/g".')] = ""
    """Sensitivities of the channels, separated by commas."""

    def description(self, **fields: Any) -> "acquisition.Description":
        """Make the description of a file. ValueError for an invalid full scale."""
        try:
            scales = tuple(float(word) for word in self.full_scale.split(",")) if self.full_scale else ()
        except ValueError as error:
            text = f'--full-scale {self.full_scale}: give a number for each channel, as in "500,50"'
            raise ValueError(text) from error
        lists = {"columns": _split_words(self.columns), "sensitivity": _split_words(self.sensitivity)}
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


def reject_file_options(options: FileOptions, **others: Any) -> None:
    """Raise ValueError for any option on a file, because a stored tap test needs none."""
    for name, value in (vars(options) | others).items():
        if value is not None and value not in ("", False):
            raise ValueError(f"--{name.replace('_', '-')}: says how a file is read; a stored tap test says it itself")


def _split_words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",")) if text else ()


def cut_fields(*values: object) -> dict[str, Any]:
    """Collect speed, depth, tool, material, teeth, diameter, radial depth and direction as fields of a [[program]]."""
    names = ("speed_rpm", "depth_mm", "tool", "material", "teeth", "tool_diameter_mm", "radial_depth_mm", "direction")
    return dict(zip(names, values, strict=True))
