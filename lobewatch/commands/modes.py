"""lobewatch modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer

from acquisition import Frf, Hit, Remark, check_hit, read_frf, read_recording
from lobewatch.show.describe import mode_json, mode_lines, mode_table, picked_table, remark_lines, remarks_on_all
from lobewatch.show.figures import save_figure
from lobewatch.show.figures_modes import modes_figure
from lobewatch.show.output import Json, emit
from modal import Mode, cut_edges, extract, modes_of, pick_peaks, remove_window


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
    frf = read_frf(file)
    frf = replace(frf, receptance=frf.receptance.conj()) if conjugate else frf
    hits = [] if conjugate else _good_hits(file)
    state = extract([frf], band)
    found, picked = modes_of(state, [hits]), pick_peaks(frf, band)
    remarks = list(_remarks(found, cut_edges(frf, found, band)))
    if figure is not None:
        save_figure(modes_figure(state, found, file.name), figure)
    fitted = [_without(window, mode) for mode in found]
    payload = {
        "file": str(file),
        "n_averages": frf.n_averages,
        "usable_band_hz": frf.usable_band,
        "modes": [mode_json(mode) for mode in fitted],
        "peak_picking": [mode_json(mode) for mode in picked],
        "remarks": [asdict(remark) for remark in remarks],
    }
    usable = "" if frf.usable_band is None else f", usable {frf.usable_band[0]:.0f} to {frf.usable_band[1]:.0f} Hz"
    lines = f"{frf.frequency.size} lines {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
    emit(
        payload,
        as_json,
        f"{file.name}: {frf.n_averages} hit(s) averaged, {lines}{usable}",
        mode_table(fitted),
        *mode_lines(fitted),
        *remark_lines(fitted, remarks),
        "peak picking (eqs. 28, 29), for comparison:",
        picked_table(picked, found),
    )


def _remarks(found: Sequence[Mode], cut: Sequence[float]) -> Iterator[Remark]:
    """On all modes together and on those that are missing; cut: where a peak may be cut (Hz)."""
    yield from remarks_on_all(found)
    for edge in cut:
        text = "a peak may be cut by the edge of the lines, its mode missing"
        yield Remark("mode-missing-at-edge", f"{edge:.0f} Hz", text, "widen the band (a harder tip reaches higher)")
    if not found:
        yield Remark("no-mode", "", "no mode found", "look whether the band is right and the hit was hard enough")


def _good_hits(file: Path) -> list[Hit]:
    """The hits that the FRF of this file was averaged from; none where it holds only an FRF."""
    recording = read_recording(file)
    return [] if isinstance(recording, Frf) else [hit for hit in recording if not check_hit(hit)]


def _without(window: float | None, mode: Mode) -> Mode:
    return mode if window is None else remove_window(mode, window)
