"""lobewatch modes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition import read_frf
from lobewatch.describe import mode_json, mode_table
from lobewatch.figures import modes_figure, save_figure
from lobewatch.output import Json, emit
from modal import fit_modes, pick_peaks


def modes(
    file: Annotated[Path, typer.Argument(help="Tap file (HDF5), LVM or CSV with hits, or CSV with an FRF.")],
    band: Annotated[tuple[float, float] | None, typer.Option(help="Only between these frequencies (Hz).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw FRF and fit to this file (.svg, .png, .pdf).")] = None,
    as_json: Json = False,
) -> None:
    """Natural frequency, damping ratio and stiffness from one recorded file.

    Each by a least-squares fit with standard errors, and beside it by the peak picking of Gaber & Hashemi (2015).

    Examples:

      lobewatch modes acceleration.lvm

      lobewatch modes tap.h5 --band 1200 2200 --figure modes.png
    """
    frf = read_frf(file)
    fitted, picked = fit_modes(frf, band), pick_peaks(frf, band)
    if figure is not None:
        save_figure(modes_figure(frf, fitted, file.name), figure)
    payload = {
        "file": str(file),
        "n_averages": frf.n_averages,
        "usable_band_hz": frf.usable_band,
        "modes": [mode_json(mode) for mode in fitted],
        "peak_picking": [mode_json(mode) for mode in picked],
    }
    usable = "" if frf.usable_band is None else f", usable {frf.usable_band[0]:.0f} to {frf.usable_band[1]:.0f} Hz"
    lines = f"{frf.frequency.size} lines {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
    emit(
        payload,
        as_json,
        f"{file.name}: {frf.n_averages} hit(s) averaged, {lines}{usable}",
        mode_table(fitted),
        "peak picking (eqs. 28, 29), for comparison:",
        mode_table(picked),
        *([] if fitted else ["no mode found: is the band right, was the hit hard enough?"]),
    )
