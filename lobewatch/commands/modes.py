"""Command `lobewatch modes`: modes of a recorded file."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from lobewatch.commands import shared_options as shared
from lobewatch.show.terminal.output import Json, emit
from lobewatch.step_times import time_step

if TYPE_CHECKING:
    from modal import ModeEdits


@shared.add_file_options(without=["averages"])
def modes(
    file: Annotated[
        Path, Argument(help="Recorded hits or an FRF: tap file, UFF, MAT, LVM, text, NumPy, HDF5, TDMS, WAV, SEP005.")
    ],
    tap: Annotated[
        str, Argument(help="Where FILE is a machine folder: its tap test, by its identity or a part that no other has.")
    ] = "",
    band: Annotated[tuple[float, float] | None, Option(help="Only between these frequencies (Hz).")] = None,
    figure: Annotated[Path | None, Option(help="Draw FRF, fit and poles to this file (.svg, .png, .pdf).")] = None,
    window: Annotated[
        float | None,
        Option(help="Time constant (s) of an exponential window on the response, where the file names none."),
    ] = None,
    window_start: Annotated[float, Option(help="When that window begins (s from the record's start).")] = 0.0,
    hit_at: Annotated[
        float | None, Option(help="When the hammer hit (s from the record's start); an FRF with --window needs it.")
    ] = None,
    averages: Annotated[
        int | None, Option(help="Hits that an FRF was averaged from; else inferred from its coherence.")
    ] = None,
    hammer: Annotated[
        Literal["none"] | None, Option(help="No force was measured: f_n and zeta alone, from the response.")
    ] = None,
    *,
    file_options: shared.FileOptions,
    accept: Annotated[
        list[str] | None, Option(help="Use hits with this verdict all the same (not-decayed); may be repeated.")
    ] = None,
    conjugate: Annotated[
        bool, Option("--conjugate", help="The file holds the complex conjugate of response over force.")
    ] = False,
    sensor_mass: Annotated[
        float | None, Option(help="Of the accelerometer (g), where it rides on the point that is hit: taken off.")
    ] = None,
    beside: Annotated[
        list[str] | None,
        Option(
            help="Another measurement of the same structure: a file, the number of another response of FILE, or where "
            "FILE is a machine folder another tap test; given twice or more. What most of them have, too, is less in "
            "doubt."
        ),
    ] = None,
    add: shared.AddedModes = None,
    drop: shared.DroppedModes = None,
    fix: shared.FixedModes = None,
    by_fit: Annotated[
        bool, Option("--by-fit", help="Take back what --add, --drop and --fix have said of TAP.")
    ] = False,
    everything: Annotated[
        bool, Option("--all", help="Show the rejected modes, too, and every remark on each mode.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Fit the modes of a recorded file or a stored tap test.

    Each by a least-squares fit with standard errors, over the hits where the file holds three or more, and beside it
    by the peak picking of Gaber & Hashemi (2015). Trusted modes come first, then doubtful ones with the reason; the
    rejected ones are counted. Hits that still ring when their record ends get an exponential window, and its damping
    is taken off again. Modes can be added, left out and held; the picture names poles that may be modes. What is said
    so of a file is only shown; of a tap test of a machine it is kept, in place of what was said of it before, and all
    that follows from it is worked out anew.

    Examples
    --------
      lobewatch modes acceleration.lvm
      lobewatch modes tap.h5 --band 1200 2200 --figure modes.png
      lobewatch modes frf.csv --window 0.05 --hit-at 0.01
      lobewatch modes decays.csv --hammer none
      lobewatch modes h.mat --response 2 --unit g/N
      lobewatch modes point1.uff --beside point2.uff --beside point3.uff
      lobewatch modes frf.csv --add 298 --fix 1500:0.03 --figure stable.png
      lobewatch modes mill-3 20261102T0914 --drop 412
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.operator_entries import read_tap_modes
    from lobewatch.machine.settings.setup_tables import SensorLoading
    from lobewatch.measurement import Window, fit_file_modes, list_comparison_files, match_modes_across_files
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.modes import file_modes_json, file_modes_texts
    from modal import parse_mode_edits

    if beside is not None and len(beside) == 1:
        raise ValueError(f"--beside {beside[0]}: one other tells nothing, its modes may be near by chance; name two")
    edits = parse_mode_edits(add, drop, fix)
    taken_off = Window.from_options(window, window_start, hit_at)
    if tap:
        others = {"band": band, "window": taken_off, "averages": averages, "accept": accept, "conjugate": conjugate}
        shared.reject_file_options(file_options, sensor_mass=sensor_mass, hammer=hammer, **others)
        logbook, choice = Logbook.open(file), _resolve_edits(edits, by_fit)
        measured = [read_tap_modes(logbook, name) for name in beside or ()]
        with nullcontext() if choice is None else publish_on_change(logbook):
            file_modes = read_tap_modes(logbook, tap, choice)
    elif by_fit or file.is_dir():
        text = "--by-fit takes back what is kept of a tap test" if by_fit else f"{file} is a folder"
        raise ValueError(f"{text}; name a tap test: lobewatch modes MACHINE TAP (lobewatch history lists them)")
    else:
        said = file_options.description(averages=averages, without_force=hammer == "none")
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
        from lobewatch.show.figures.drawing import save_figure
        from lobewatch.show.figures.spindle_figures import plot_modes

        save_figure(plot_modes(file_modes.extraction, file_modes.as_recorded, file.name), figure)
    emit(file_modes_json(file_modes), as_json, *file_modes_texts(file_modes, everything=everything))


def _resolve_edits(edits: "ModeEdits", by_fit: bool) -> "ModeEdits | None":
    """Return the edits to store, empty ones to withdraw all, or None to store nothing."""
    if edits and by_fit:
        raise ValueError("--by-fit takes back all that is said by hand; leave --add, --drop and --fix out")
    return edits if edits or by_fit else None
