"""Command `lobewatch demo`: tap tests of an aging simulated spindle."""

import itertools
from pathlib import Path
from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import ReclampingScatter, Seed, WearScenarioName
from lobewatch.show.terminal.output import Json, emit, show_progress
from lobewatch.step_times import time_step


def demo(
    out: Annotated[Path | None, Option(help="A new folder; lobewatch-demo where not given.")] = None,
    taps: Annotated[int, Option(min=2, max=120, help="How many months; each has one tap test in x and one in y.")] = 24,
    seed: Seed = 1,
    scatter: ReclampingScatter = 0.1,
    story: Annotated[WearScenarioName, Option(help="What befalls the bearings.")] = "steady",
    bad_clampings: Annotated[float, Option(help="Share of tests clamped badly: f_1 2 % low, 0 to 50 %.")] = 0.0,
    temperature: Annotated[
        float | None, Option(help="Recorded, and swings by so much over the year: 0 to 30 K; f_1 with it.")
    ] = None,
    tcp: Annotated[bool, Option("--tcp", help="Through a TCP port of this computer.")] = False,
    as_json: Json = False,
) -> None:
    """Tap a simulated aging spindle, and write a report.

    Every test goes through a real serial port (a pseudo-terminal; TCP where there is none), byte by byte: ten good
    hits, FRF, HDF5, modes, bearing stiffness, stability lobes, history. Before each the tool is remounted, which moves
    f_1 a little. What was emulated in that very test is printed beside what was found. The months end with this one,
    or the one before it.

    Examples
    --------
      lobewatch demo
      lobewatch demo --out trial --taps 12 --story step --bad-clampings 5
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine import MachineFolder, make_machine_folder
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.demo import demo_json, demo_texts
    from lobewatch.show.report.report import write_report
    from lobewatch.tap.demo import age_spindle, compare_with_truth, forecast_levels
    from lobewatch.tap.emulated_spindle import MountingVariation, SpindleWear, WearScenario

    mounting = MountingVariation(scatter / 100, bad_clampings / 100, temperature)
    mounting.check()
    path = out or _find_free_name()
    make_machine_folder(path, "surrogate_machine.toml")
    folder = MachineFolder(path)
    with show_progress("tap tests") as progress:
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
