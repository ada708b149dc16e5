"""lobewatch modes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.show.output import Json, emit


def modes(
    file: Annotated[Path, typer.Argument(help="Tap file (HDF5), LVM or CSV with hits, or CSV with an FRF.")],
    band: Annotated[tuple[float, float] | None, typer.Option(help="Only between these frequencies (Hz).")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw FRF, fit and poles to this file (.svg, .png, .pdf).")
    ] = None,
    window: Annotated[
        float | None, typer.Option(help="Time constant (s) of an exponential window on the response, to be corrected.")
    ] = None,
    conjugate: Annotated[
        bool, typer.Option("--conjugate", help="The file holds the complex conjugate of response over force.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Natural frequency, damping ratio and stiffness from one recorded file.

    Each by a least-squares fit with standard errors, over the hits where the file holds three or more, and beside it
    by the peak picking of Gaber & Hashemi (2015). What speaks against a mode is said below the table.

    Examples:

      lobewatch modes acceleration.lvm
      lobewatch modes tap.h5 --band 1200 2200 --figure modes.png
    """
    from lobewatch.analysis import modes_of_file
    from lobewatch.show.describe import file_modes_json, file_modes_texts

    found = modes_of_file(file, band, window=window, conjugate=conjugate)
    if figure is not None:
        from lobewatch.show.figures import save_figure
        from lobewatch.show.figures_modes import modes_figure

        save_figure(modes_figure(found.extraction, found.as_recorded, file.name), figure)
    emit(file_modes_json(found), as_json, *file_modes_texts(found))
