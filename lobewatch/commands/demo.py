"""Command `lobewatch demo`: tap tests of an aging simulated spindle."""

import itertools
from pathlib import Path
from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import ReclampingScatter, Seed, WearScenarioName
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step

DIRECTION_DIFFERENCE = 2e-4
"""Relative difference of f1 in x and y of a demo without scatter, chosen. Without any, y repeats x."""


def demo(
    out: Annotated[Path | None, Option(help="New folder. Default: lobewatch-demo.")] = None,
    taps: Annotated[int, Option(min=2, max=120, help="Number of months, each with a tap test in x and in y.")] = 24,
    seed: Seed = 1,
    scatter: ReclampingScatter = 0.1,
    story: Annotated[WearScenarioName, Option(help="Bearing wear scenario.")] = "steady",
    bad_clampings: Annotated[float, Option(help="Share of bad clampings (%), which lower f1 by 2 %: 0 to 50.")] = 0.0,
    temperature: Annotated[
        float | None, Option(help="Yearly temperature swing (K), 0 to 30, which moves f1. Default: no temperature.")
    ] = None,
    tcp: Annotated[bool, Option("--tcp", help="Use a TCP port instead of a pseudo-terminal.")] = False,
    as_json: Json = False,
) -> None:
    """Tap a simulated ageing spindle, and write a report.

    Each test runs byte by byte through a serial port: ten good hits, FRF, modes, bearing stiffness, stability lobes.
    The tool is reclamped before each test. Results are shown next to the true values of the simulated spindle.

    Examples
    --------
      lobewatch demo
      lobewatch demo --out trial --taps 12 --story step --bad-clampings 5
    """
    with show_progress("tap tests") as progress:
        from lobewatch.logbook import Logbook
        from lobewatch.machine import MachineFolder, make_machine_folder
        from lobewatch.notify.publish_status import publish_on_change
        from lobewatch.show.demo import demo_json, demo_texts
        from lobewatch.show.report.report import write_report
        from lobewatch.tap.demo import age_spindle, compare_with_truth, forecast_levels
        from lobewatch.tap.emulated_spindle import MountingVariation, SpindleWear, WearScenario

        differ = 0.0 if scatter else DIRECTION_DIFFERENCE
        mounting = MountingVariation(scatter / 100, bad_clampings / 100, temperature, differ)
        mounting.check()
        path = out or _find_free_name()
        make_machine_folder(path, "surrogate_machine.toml")
        folder = MachineFolder(path)
        wear = SpindleWear.of(folder, taps, WearScenario(story))
        tests = age_spindle(folder, wear, seed, mounting, tcp=tcp)
        with time_step("tap tests"):
            taken = list(progress.track(tests, total=2 * taps, task_id=progress.task_ids[0]))
        progress.add_task("history and report", total=None)
        logbook = Logbook(folder)
        compared = compare_with_truth(logbook, taken)
        forecasts = forecast_levels(logbook, wear)
        with publish_on_change(logbook), time_step("report"):
            report = write_report(logbook)
    emit(demo_json(compared, forecasts, report), as_json, *demo_texts(compared, forecasts, mounting.scatter, report))


def _find_free_name() -> Path:
    names = itertools.chain(["lobewatch-demo"], (f"lobewatch-demo-{i}" for i in itertools.count(2)))
    return next(path for path in map(Path, names) if not path.exists())
