"""Command `lobewatch trend`: trend and forecast of a series."""

from typing import Annotated

from typer import Exit, Option

from lobewatch.commands.shared_options import Machine, Now
from lobewatch.show.terminal.output import Json, emit, print_remarks, results


def trend(
    machine: Machine,
    tool: Annotated[str | None, Option(help="Tool of the series. Default: tool of the worst series.")] = None,
    direction: Annotated[
        str | None, Option(help="Direction of the series: x or y. Default: direction of the worst series.")
    ] = None,
    as_csv: Annotated[bool, Option("--csv", help="CSV of the points on stdout.")] = False,
    now: Now = None,
    as_json: Json = False,
) -> None:
    """Show the frequency trend of a series.

    Exit code 1: the machine is on alarm.

    Examples
    --------
      lobewatch trend mill-3
      lobewatch trend mill-3 --direction y --json
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.machine_forecast import forecast_machine
    from lobewatch.monitoring import StatusLevel
    from lobewatch.monitoring.series_history import estimate_preload
    from lobewatch.show.trend import trend_csv, trend_json, trend_remarks, trend_texts

    if as_csv and as_json:
        raise ValueError("--csv cannot be used with --json. Leave out one of the two options.")
    logbook = Logbook.open(machine, now)
    machine_outlook = forecast_machine(logbook)
    series = machine_outlook.series(tool, direction)
    if as_csv:
        results.out(trend_csv(series), end="", highlight=False)
    else:
        preload = estimate_preload(series.history, logbook.machine)
        texts = [] if as_json else trend_texts(machine_outlook, series, preload)
        emit(trend_json(machine_outlook, series, preload), as_json, *texts)
    remarks = machine_outlook.status.remarks if as_csv or as_json else trend_remarks(machine_outlook)
    print_remarks([*remarks, *logbook.remarks])
    raise Exit(int(machine_outlook.status.status is StatusLevel.ALARM))
