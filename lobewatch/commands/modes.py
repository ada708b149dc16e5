"""lobewatch modes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.commands.file_options import FileOptions, takes_file_options
from lobewatch.show.terminal.output import Json, emit


@takes_file_options(without=["averages"])
def modes(
    file: Annotated[
        Path,
        typer.Argument(help="Recorded hits or an FRF: tap file, UFF, MAT, LVM, text, NumPy, HDF5, TDMS, WAV, SEP005."),
    ],
    band: Annotated[tuple[float, float] | None, typer.Option(help="Only between these frequencies (Hz).")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Draw FRF, fit and poles to this file (.svg, .png, .pdf).")
    ] = None,
    window: Annotated[
        float | None,
        typer.Option(help="Time constant (s) of an exponential window on the response, where the file names none."),
    ] = None,
    window_start: Annotated[float, typer.Option(help="When that window begins (s from the record's start).")] = 0.0,
    hit_at: Annotated[
        float | None,
        typer.Option(help="When the hammer hit (s from the record's start); an FRF with --window needs it."),
    ] = None,
    averages: Annotated[
        int | None,
        typer.Option(help="Hits that an FRF was averaged from; else inferred from its coherence."),
    ] = None,
    *,
    file_options: FileOptions,
    accept: Annotated[
        list[str] | None, typer.Option(help="Use hits with this verdict all the same (not-decayed); may be repeated.")
    ] = None,
    conjugate: Annotated[
        bool, typer.Option("--conjugate", help="The file holds the complex conjugate of response over force.")
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="Show the rejected modes, too, and every remark on each mode.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Natural frequency, damping ratio and stiffness from one recorded file.

    Each by a least-squares fit with standard errors, over the hits where the file holds three or more, and beside it
    by the peak picking of Gaber & Hashemi (2015). Trusted modes come first, then doubtful ones with the reason; the
    rejected ones are counted. Hits that still ring when their record ends get an exponential window, and its damping
    is taken off again.

    Examples:

      lobewatch modes acceleration.lvm
      lobewatch modes tap.h5 --band 1200 2200 --figure modes.png
      lobewatch modes frf.csv --window 0.05 --hit-at 0.01
      lobewatch modes h.mat --response 2 --unit g/N
    """
    from lobewatch.measuring import Window, modes_of_file
    from lobewatch.show.spindle.describe_modes import file_modes_json, file_modes_texts

    of_window = window is not None or hit_at is not None or window_start != 0
    taken_off = Window(float("nan") if window is None else window, window_start, hit_at) if of_window else None
    description = file_options.description(averages=averages)
    file_modes = modes_of_file(
        file, band, window=taken_off, conjugate=conjugate, accept=accept or (), description=description
    )
    if figure is not None:
        from lobewatch.show.figures.mode_figures import modes_figure
        from lobewatch.show.figures.style import save_figure

        save_figure(modes_figure(file_modes.extraction, file_modes.as_recorded, file.name), figure)
    emit(file_modes_json(file_modes), as_json, *file_modes_texts(file_modes, everything=everything))
