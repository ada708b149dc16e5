"""Command `lobewatch shapes`: mode shapes along tool, holder, spindle and column."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from lobewatch.commands.shared_options import FileOptions, add_file_options
from lobewatch.show.terminal.output import Json, emit


@add_file_options(without=["averages", "force"])
def shapes(
    folder: Annotated[Path, Argument(help="Folder with points.csv and the recorded files.")],
    band: Annotated[tuple[float, float] | None, Option(help="Frequency band (Hz).")] = None,
    figure: Annotated[Path | None, Option(help="Animated figure (.svg, .html).")] = None,
    against: Annotated[Path | None, Option(help="Earlier folder to compare by MAC.")] = None,
    *,
    file_options: FileOptions,
    everything: Annotated[bool, Option("--all", help="Show rejected modes and all remarks too.")] = False,
    as_json: Json = False,
) -> None:
    """Show mode shapes from tool to column, and the share of each part in 1/K at the tip.

    Each file has the hits or the FRF between one point and the tool tip. points.csv has a line per file with the
    columns point, position_mm (from the tip), part (tool, holder, spindle, column) and file. Further columns: role
    (hit: hammer at the point, sensor at the tip), direction (-x: against the tip), number (response in the file),
    node (point number in a universal file).

    Examples
    --------
      lobewatch shapes mill-3-points
      lobewatch shapes mill-3-points --figure shapes.html
      lobewatch shapes mill-3-points --against mill-3-points-2025
      lobewatch shapes points --columns "frequency [Hz],real [m/N],imag" --band 800 3500
    """
    from lobewatch.measurement import measure_folder_shapes
    from lobewatch.show.figures.shape_animation import save_shape_animation
    from lobewatch.show.shapes import folder_shapes_json, folder_shapes_texts

    description = file_options.description()
    found = measure_folder_shapes(folder, band, description)
    reference = None if against is None else measure_folder_shapes(against, band, description)
    payload = folder_shapes_json(found, reference)
    if figure is not None:
        save_shape_animation(found, figure)
    emit(payload, as_json, *folder_shapes_texts(found, reference, everything=everything))
