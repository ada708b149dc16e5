"""Command `lobewatch modes`: modes of a recorded file."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Context, Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, emit
from lobewatch.step_times import time_step

if TYPE_CHECKING:
    from lobewatch.measurement import FileModes
    from modal import ModeEdits


FIT_OPTIONS = ("band", "window", "window_start", "hit_at", "averages", "accept", "conjugate", "sensor_mass", "hammer")
"""Names of the options on the fit of a file."""


@shared.add_file_options(without=["averages"])
def modes(
    ctx: Context,
    file: Annotated[
        Path,
        Argument(help="Machine folder, or recorded hits or FRF: UFF, MAT, LVM, text, NumPy, HDF5, TDMS, WAV, SEP005."),
    ],
    names: Annotated[
        list[str] | None,
        Argument(
            metavar="[TAP]...",
            help="Tap test of a machine folder: ID, or a unique part of it. With --one-test: more files of the test.",
        ),
    ] = None,
    band: Annotated[tuple[float, float] | None, Option(help="Frequency band (Hz).")] = None,
    figure: Annotated[Path | None, Option(help="Figure of FRF, fit and poles (.svg, .png, .pdf).")] = None,
    window: Annotated[
        float | None,
        Option(help="Time constant (s) of an exponential window on the response. Default: from the file."),
    ] = None,
    window_start: Annotated[float, Option(help="Start of the window (s).")] = 0.0,
    hit_at: Annotated[float | None, Option(help="Time of the hit (s). Needed for an FRF with --window.")] = None,
    averages: Annotated[int | None, Option(help="Averaged hits of an FRF. Default: from its coherence.")] = None,
    hammer: Annotated[
        Literal["none"] | None, Option(help="No force was measured. Gives natural frequencies and damping only.")
    ] = None,
    *,
    file_options: shared.FileOptions,
    accept: Annotated[list[str] | None, Option(help="Accept hits with this verdict (not-decayed), repeatable.")] = None,
    conjugate: Annotated[
        bool, Option("--conjugate", help="The FRF in the file is the complex conjugate of response over force.")
    ] = False,
    sensor_mass: Annotated[
        float | None, Option(help="Accelerometer mass (g) at the hit point, whose effect is removed.")
    ] = None,
    beside: Annotated[
        list[str] | None,
        Option(
            help="Another measurement (file, response number or tap test) to confirm modes. Give two or more --beside."
        ),
    ] = None,
    accept_hit: shared.AcceptedHits = None,
    reject_hit: shared.RejectedHits = None,
    undo_hit: Annotated[list[int] | None, Option(help="Withdraw the decision on this hit of TAP, repeatable.")] = None,
    add: shared.AddedModes = None,
    drop: shared.DroppedModes = None,
    fix: shared.FixedModes = None,
    by_fit: Annotated[bool, Option("--by-fit", help="Withdraw --add, --drop and --fix of TAP.")] = False,
    everything: Annotated[bool, Option("--all", help="Show rejected modes and all remarks too.")] = False,
    as_json: Json = False,
) -> None:
    """Fit the modes of a recorded file or a stored tap test.

    The least-squares fit gives standard errors. Peak picking after Gaber & Hashemi (2015) is shown for comparison. With
    TAP, --add, --drop, --fix and decisions on hits are stored, and all results of the machine are updated.

    Examples
    --------
      lobewatch modes acceleration.lvm
      lobewatch modes tap.h5 --band 1200 2200 --figure modes.png
      lobewatch modes frf.csv --window 0.05 --hit-at 0.01
      lobewatch modes decays.csv --hammer none
      lobewatch modes h.mat --response 2 --unit g/N
      lobewatch modes point1.uff --beside point2.uff --beside point3.uff
      lobewatch modes hit1.csv hit2.csv hit3.csv --one-test
      lobewatch modes frf.csv --add 298 --fix 1500:0.03 --figure stable.png
      lobewatch modes mill-3 20261102T0914 --drop 412
      lobewatch modes mill-3 20261102T0914 --accept-hit 3:double-hit --reject-hit 5
    """
    from acquisition.hit_quality.decide_hits import parse_hit_decisions
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.operator_entries import read_tap_modes
    from lobewatch.machine.settings.setup_tables import SensorLoading
    from lobewatch.measurement import Window, fit_file_modes, list_comparison_files, match_modes_across_files
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.modes import file_modes_json, file_modes_texts
    from modal import parse_mode_edits

    if beside is not None and len(beside) == 1:
        raise ValueError(f"--beside {beside[0]}: one other file may agree by chance. Give --beside twice or more.")
    edits = parse_mode_edits(add, drop, fix)
    decisions = parse_hit_decisions(accept_hit or (), reject_hit or (), undo_hit or ())
    file, tap, hit_files = _resolve_names(file, names or (), one_test=file_options.one_test)
    taken_off = Window.from_options(window, window_start, hit_at)
    if tap:
        shared.reject_options(ctx, [*vars(file_options), *FIT_OPTIONS], "does not apply to a stored tap test")
        logbook, choice = Logbook.open(file), _resolve_edits(edits, by_fit)
        measured = [read_tap_modes(logbook, name) for name in beside or ()]
        with publish_on_change(logbook):
            file_modes = read_tap_modes(logbook, tap, choice, decisions)
    elif by_fit or undo_hit or file.is_dir():
        raise _make_tap_error(file, "--by-fit" if by_fit else "--undo-hit" if undo_hit else "")
    else:
        known = {"hit_files": hit_files, "hit_decisions": decisions}
        said = file_options.description(averages=averages, without_force=hammer == "none", **known)
        sensor = SensorLoading.of(sensor_mass)
        how = partial(
            fit_file_modes, band=band, window=taken_off, conjugate=conjugate, accept=accept or (), sensor=sensor
        )
        with time_step("fitting"):
            file_modes = how(file, description=said, by_hand=edits)
            measured = [how(path, description=known) for path, known in list_comparison_files(beside or (), file, said)]
    if beside:
        file_modes = match_modes_across_files(file_modes, beside, measured)
    if figure is not None:
        _save_figure(file_modes, file.name, figure)
    emit(file_modes_json(file_modes), as_json, *file_modes_texts(file_modes, everything=everything))


def _make_tap_error(file: Path, option: str) -> ValueError:
    """Return the error for a folder, or an option, without a tap test."""
    text = f"{option} needs a stored tap test" if option else f"{file} is a folder"
    return ValueError(f"{text}. Name a tap test from lobewatch history: lobewatch modes MACHINE TAP")


def _resolve_names(file: Path, names: Sequence[str], *, one_test: bool) -> tuple[Path, str, tuple[Path, ...]]:
    """Return the file or folder, the tap test of the folder, and the further files of one tap test."""
    from lobewatch.logbook.recordings.recorded_files import find_recordings

    if one_test:
        first, *others = find_recordings([file, *names], repeated=True)[0]
        return first, "", tuple(others)
    if len(names) > 1:
        text = f"{len(names) + 1} files. Give --one-test if they are hits of one tap test, or name a single file"
        raise ValueError(f"{text}, or a machine folder and one tap test.")
    return file, names[0] if names else "", ()


def _save_figure(file_modes: "FileModes", name: str, figure: Path) -> None:
    from lobewatch.show.figures.drawing import save_figure
    from lobewatch.show.figures.spindle_figures import plot_modes

    save_figure(plot_modes(file_modes.extraction, file_modes.as_recorded, name), figure)


def _resolve_edits(edits: "ModeEdits", by_fit: bool) -> "ModeEdits | None":
    """Return the edits to store, empty ones to withdraw all, or None to store nothing."""
    if edits and by_fit:
        raise ValueError("--by-fit cannot be used with --add, --drop or --fix. Leave out --by-fit, or the others.")
    return edits if edits or by_fit else None
