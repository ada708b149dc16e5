"""The modes of one recorded file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition import Frf, Hit, Remark, check_hit, read_frf, read_recording
from modal import Extraction, Mode, cut_edges, extract, modes_of, pick_peaks, remove_window


@dataclass(frozen=True, eq=False)
class FileModes:
    """The modes of one recorded file."""

    path: Path
    """Where it was read from."""
    frf: Frf
    """The average of its hits."""
    extraction: Extraction
    """How the modes were found."""
    as_recorded: tuple[Mode, ...]
    """By least squares, the damping of an exponential window still in them."""
    fitted: tuple[Mode, ...]
    """The same without it."""
    picked: tuple[Mode, ...]
    """By the peak picking of the paper, for comparison."""
    remarks: tuple[Remark, ...]
    """On all modes together, and on those that are missing."""


def modes_of_file(
    path: Path, band: tuple[float, float] | None = None, *, window: float | None = None, conjugate: bool = False
) -> FileModes:
    """Modes between two frequencies (Hz), with standard errors over the hits where the file holds three or more.

    window: time constant (s) of an exponential window on the response, to be corrected. conjugate: the file holds the
    complex conjugate of response over force.
    """
    frf = read_frf(path)
    frf = replace(frf, receptance=frf.receptance.conj()) if conjugate else frf
    state = extract([frf], band)
    found = tuple(modes_of(state, [[] if conjugate else _good_hits(path)]))
    return FileModes(
        path=path,
        frf=frf,
        extraction=state,
        as_recorded=found,
        fitted=found if window is None else tuple(remove_window(mode, window) for mode in found),
        picked=tuple(pick_peaks(frf, band)),
        remarks=tuple(_remarks(found, cut_edges(frf, found, band))),
    )


def _good_hits(path: Path) -> list[Hit]:
    """The hits that the FRF of this file was averaged from; none where it holds only an FRF."""
    recording = read_recording(path)
    return [] if isinstance(recording, Frf) else [hit for hit in recording if not check_hit(hit)]


def _remarks(found: Sequence[Mode], edges: Sequence[float]) -> Iterator[Remark]:
    """edges: where a peak may be cut (Hz)."""
    yield from remarks_on_all(found)
    for edge in edges:
        text = "a peak may be cut by the edge of the lines, its mode missing"
        yield Remark("mode-missing-at-edge", f"{edge:.0f} Hz", text, "widen the band (a harder tip reaches higher)")
    if not found:
        yield Remark("no-mode", "", "no mode found", "look whether the band is right and the hit was hard enough")


def remarks_on_all(modes: Sequence[Mode]) -> list[Remark]:
    """What speaks against all modes of an FRF together."""
    if len(modes) < 2 or any(mode.is_driving_point for mode in modes):
        return []
    text = "every K is negative: hammer or sensor is mounted or wired the other way round"
    return [Remark("sign-swapped", "", text, "turn it, or give its sensitivity the other sign")]
