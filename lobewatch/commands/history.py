"""Command `lobewatch history`: list the tap tests and events of a machine."""

from pathlib import Path
from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import AsCsv, Machine
from lobewatch.show.terminal.output import Json, emit, print_remarks, results


def history(
    machine: Machine,
    as_csv: AsCsv = False,
    hdf5: Annotated[Path | None, Option(help="HDF5 file for all values and diagrams of every test.")] = None,
    as_json: Json = False,
) -> None:
    """Show the history of a machine.

    Each tap test is listed with its verdicts at that time. Times are UTC in --csv and --json.

    Examples
    --------
      lobewatch history mill-3
      lobewatch history mill-3 --csv
      lobewatch history mill-3 --hdf5 history.h5
    """
    from lobewatch.logbook import Logbook
    from lobewatch.show.history import history_csv, history_json, history_lines

    if as_csv and as_json:
        raise ValueError("--csv cannot be used with --json. Leave out one of the two options.")
    logbook = Logbook.open(machine)
    if hdf5 is not None:
        from lobes import write_history
        from lobewatch.history.history import make_export_columns
        from lobewatch.show.terminal.option_names import with_option_names

        write_history(hdf5, make_export_columns(logbook.checked_history, logbook.machine, with_option_names))
    if as_csv:
        results.out(history_csv(logbook), end="", highlight=False)
    else:
        emit(history_json(logbook), as_json, *history_lines(logbook))
    kept = [remark for row in logbook.history.kept for remark in row.remarks if remark.code == "row-kept"]
    print_remarks([*logbook.remarks, *kept])
