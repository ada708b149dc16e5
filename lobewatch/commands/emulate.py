"""lobewatch emulate: a command for every driver that can be emulated."""

from __future__ import annotations

import inspect
import json
import math
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, notes, results

if TYPE_CHECKING:
    from acquisition import EmulatorThread
    from dsm import Spindle
    from lobewatch.machine import MachineFolder

StoryName = Literal["steady", "step", "accelerating", "replaced", "none"]
emulate = typer.Typer(help="A data acquisition device made of software, on a pseudo-terminal.", no_args_is_help=True)

Machine = Annotated[
    Path, typer.Argument(parser=named_folder, help="Machine folder with a spindle in its machine.toml: what is hit.")
]
Tcp = Annotated[bool, typer.Option("--tcp", help="On a TCP port of this computer instead.")]
Fast = Annotated[bool, typer.Option("--fast", help="As fast as the host reads, not in real time.")]
Seed = Annotated[int, typer.Option(help="Of the random numbers.")]
Told = Annotated[StoryName, typer.Option("--story", help="What befalls the bearings over 24 months.")]
Month = Annotated[int, typer.Option("--month", min=0, max=60, help="Of the story, in which it is tapped.")]
Scatter = Annotated[float, typer.Option(help="Scatter of f_1 by remounting: standard deviation, 0 to 5 %.")]
Bad = Annotated[float, typer.Option("--bad-clampings", help="Chance that it is clamped badly: f_1 2 % low, 0 to 50 %.")]
Warm = Annotated[float | None, typer.Option("--temperature", help="Swing over the year, 0 to 30 K; f_1 moves with it.")]
Cutting = Annotated[
    str | None, typer.Option("--cut", metavar="PROGRAM", help="It cuts this, and is heard on its housing.")
]
Speed = Annotated[float | None, typer.Option("--speed", help="Of the cut, as it is told (rpm).")]
Depth = Annotated[float | None, typer.Option("--depth", help="Of the cut (mm).")]
MONTHS = 24
"""Of a story."""


def _add_commands() -> None:
    from acquisition.devices import driver_names, find_driver
    from acquisition.errors import DataError

    for name in driver_names():
        try:
            driver = find_driver(name)
        except DataError as error:  # said here, and again by the command
            emulate.command(name, help=f"{error}.")(_command(name, takes_fast=False))
            continue
        if driver.emulate is not None:
            emulate.command(name, help=_help(name, driver.title))(_command(name, driver.emulates_fast))


def _command(name: str, takes_fast: bool) -> Callable[..., None]:
    """What a driver is emulated with; takes_fast: whether --fast is among it."""

    def run(
        machine: Machine,
        tcp: Tcp = False,
        fast: Fast = False,
        seed: Seed = 1,
        story: Told = "none",
        month: Month = 0,
        scatter: Scatter = 0.0,
        bad: Bad = 0.0,
        warm: Warm = None,
        cut: Cutting = None,
        speed: Speed = None,
        depth: Depth = None,
        as_json: Json = False,
    ) -> None:
        _serve(
            _Served(name, machine, tcp, fast, seed, as_json), (story, month, scatter, bad, warm), (cut, speed, depth)
        )

    taken = inspect.signature(run, eval_str=True).parameters
    kept = [one for one in taken.values() if takes_fast or one.name != "fast"]
    run.__signature__ = inspect.Signature(kept)  # type: ignore[attr-defined]
    return run


def _help(name: str, title: str) -> str:
    return (
        f"{title[:1].upper()}{title[1:]} with somebody who taps twice a second; Ctrl-C ends it.\n\nExamples:\n\n"
        f"  lobewatch emulate {name} trial\n  lobewatch tap trial --port /dev/pts/3  # in another window\n"
        f"  lobewatch emulate {name} trial --cut 'A: slot at 12 600 rpm' --depth 2"
    )


Asked = tuple[StoryName, int, float, float, float | None]
"""Story, month, scatter (%), chance of a bad clamping (%), swing of the temperature (K)."""


Chosen = tuple[str | None, float | None, float | None]
"""Program, speed (rpm) and depth (mm) of a cut."""


class _Served(NamedTuple):
    name: str
    machine: Path
    tcp: bool
    fast: bool
    seed: int
    as_json: bool


def _serve(served: _Served, asked: Asked, chosen: Chosen) -> None:
    """Somebody taps, or cuts where a program was chosen; until Ctrl-C."""
    from lobewatch.machine.folder import MachineFolder

    folder = MachineFolder(served.machine)
    spindle = _spindle(folder, asked, served.seed)
    program, speed, depth = chosen
    if program is not None:
        _serve_cut(served, folder, spindle, (program, speed, depth))
        return
    if (speed, depth) != (None, None):
        raise ValueError("--speed and --depth are those of a cut: give --cut PROGRAM with them")
    from acquisition.devices import find_driver
    from lobewatch.tap.emulated_spindle import emulate_machine

    driver = find_driver(served.name)
    emulated = emulate_machine(folder, driver, served.seed, realtime=not served.fast, tcp=served.tcp, spindle=spindle)
    truth = {"frequency_hz": emulated.frequency, "stiffness_n_per_m": emulated.stiffness}
    said = f"f_1 {emulated.frequency:.2f} Hz, K {emulated.stiffness / 1e6:.3f} N/um"
    _until_interrupted(served, emulated.device, truth, said, "tap with: lobewatch tap {machine} --port {port}")


def _serve_cut(
    served: _Served, folder: MachineFolder, spindle: Spindle | None, chosen: tuple[str, float | None, float | None]
) -> None:
    from acquisition.devices import find_driver
    from lobewatch.machine.settings.cut_setting import cut_setting
    from lobewatch.tap.milling.emulated_cut import emulate_cut

    setting = cut_setting(folder.machine, *chosen)
    driver = find_driver(served.name)
    emulated = emulate_cut(
        folder, driver, setting, served.seed, realtime=not served.fast, tcp=served.tcp, spindle=spindle
    )
    limit = 1e3 * emulated.limit if math.isfinite(emulated.limit) else None
    truth = {"speed_rpm": emulated.speed_rpm, "limit_mm": limit} | emulated.truth.told
    stable = "any depth" if limit is None else f"{limit:.3g} mm"
    said = f"{emulated.speed_rpm:.1f} rpm, stable up to {stable} there ({1e3 * setting.depth:g} mm is cut)"
    how = f"--program {shlex.quote(chosen[0])} --speed {setting.speed_rpm:g} --depth {1e3 * setting.depth:g}"
    _until_interrupted(
        served, emulated.device, truth, said, f"listen with: lobewatch listen {{machine}} --port {{port}} {how}"
    )


def _until_interrupted(
    served: _Served, emulated: EmulatorThread, truth: Mapping[str, float | None], said: str, next_step: str
) -> None:
    """Say where the device is and what is behind it, and serve until Ctrl-C."""
    with emulated as device:
        line = json.dumps({"port": device.port, **truth}) if served.as_json else f"port {device.port}"
        results.print(line, markup=False)
        results.file.flush()
        notes.print(f"the truth: {said}", markup=False)
        step = next_step.format(machine=shlex.quote(str(served.machine)), port=device.port)
        notes.print(f"{step}   (Ctrl-C ends the emulator)", markup=False)
        device.wait()


def _spindle(folder: MachineFolder, asked: Asked, seed: int) -> Spindle | None:
    """As it is mounted in that month; None for that of machine.toml as it stands there."""
    from lobewatch.tap.stories.mounted import mounted_at
    from lobewatch.tap.stories.mounting import Mounting
    from lobewatch.tap.stories.story import Story

    story, month, scatter, bad, warm = asked
    mounting = Mounting(scatter / 100, bad / 100, warm)
    mounting.check()
    if story == "none" and not any(mounting):
        return None
    return mounted_at(folder, Story(story), MONTHS, month, mounting, seed)


_add_commands()
