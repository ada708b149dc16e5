"""Command `lobewatch emulate`: emulate a device, with a subcommand for each driver."""

import inspect
import json
import math
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import typer
from typer import Option

import acquisition
from lobewatch.commands import COMMANDS
from lobewatch.commands.shared_options import FolderArgument, ReclampingScatter, Seed, WearScenarioName, length, rpm
from lobewatch.machine.settings.display_units import LENGTH, length_argument
from lobewatch.show.terminal.output import Json, notes, results

emulate = typer.Typer(help=COMMANDS["emulate"], no_args_is_help=True)

EmulatedFaultName: TypeAlias = Literal[
    "none",
    "response-cable",
    "force-cable",
    "open-input",
    "saturated",
    "swapped",
    "falling-sensor",
    "soft-tip",
    "mains-hum",
]
"""Name of an emulated fault."""
SCENARIO_MONTHS = 24
"""Length of a wear scenario (months)."""


@dataclass(frozen=True, kw_only=True)
class EmulateOptions:
    """Options of an emulator, in the order of the help page."""

    machine: Annotated[Path, FolderArgument(help="Machine folder. Without [spindle], the example spindle is emulated.")]
    """Machine folder."""
    tcp: Annotated[bool, Option("--tcp", help="Use a TCP port instead of a pseudo-terminal.")] = False
    """True to use a TCP port instead of a pseudo-terminal."""
    fast: Annotated[bool, Option("--fast", help="Send samples as fast as the host reads them.")] = False
    """True to run faster than real time; not every driver can."""
    seed: Seed = 1
    """Seed of the random numbers."""
    story: Annotated[WearScenarioName, Option(help="Bearing wear scenario (24 months).")] = "none"
    """Wear scenario of the bearings."""
    month: Annotated[int, Option(min=0, max=60, help="Month of the wear scenario.")] = 0
    """Month of the wear scenario."""
    scatter: ReclampingScatter = 0.0
    """Reclamping repeatability of f1: standard deviation (%)."""
    bad_clampings: Annotated[float, Option(help="Probability of a bad clamping (%), 0 to 50.")] = 0.0
    """Chance of a bad clamping (%)."""
    temperature: Annotated[float | None, Option(help="Yearly temperature swing (K), 0 to 30.")] = None
    """Swing of the temperature over the year (K)."""
    direction: Annotated[
        Literal["x", "y", "xy"], Option(help="Direction of hammer and sensor. xy: hit in x, sensor in y.")
    ] = "x"
    """Direction of hammer and sensor."""
    askew: Annotated[
        float | None,
        Option(help="Angle of the principal directions from x (deg), 0 to 90."),
    ] = None
    """Angle of the principal directions from x (deg). None for a round spindle."""
    fault: Annotated[EmulatedFaultName, Option(help="Fault of sensors, cables or hammer in an emulated tap test.")] = (
        "none"
    )
    """Fault of the measurement chain."""
    turning: Annotated[float, Option(min=0, max=200_000, help="Spindle speed in a tap test (rpm).")] = 0.0
    """Speed of a spindle that turns while it is tapped (rpm)."""
    fault_after: Annotated[float, Option(min=0, help="Time at which --fault and --turning begin (s).")] = 0.0
    """Time at which fault and turning begin (s)."""
    clock_error: Annotated[
        float, Option(min=-50, max=50, help="Error of the sample clock (%), of which the device does not know.")
    ] = 0.0
    """Error of the sample clock (%)."""
    mass_kg: Annotated[
        float | None, Option(help="Hung mass that is hit instead of the spindle (kg), for lobewatch sensors.")
    ] = None
    """Hung mass that is hit instead of the spindle (kg). None for the spindle."""
    cut: Annotated[
        str | None,
        Option(metavar="PROGRAM", help="Program of an emulated cut. Default: tap tests, no cut."),
    ] = None
    """Name of the program to cut. None for tap tests."""
    speed: Annotated[float | None, Option(parser=rpm, help="Spindle speed of the cut (rpm).")] = None
    """Spindle speed of the cut (rpm). None for that of the program."""
    depth: Annotated[float | None, Option(parser=length, help="Axial depth of the cut ap (mm).")] = None
    """Axial depth of cut (mm). None for that of the program."""
    as_json: Json = False
    """True to print the result as JSON."""


Emulation: TypeAlias = "tuple[acquisition.EmulatorThread, Mapping[str, float | None], str, str, str]"
"""Emulator, which serves while its context lasts; its true values by JSON key, and as text; the next command and its
options without the port."""


def _add_commands() -> None:
    from acquisition import find_driver, list_driver_names
    from acquisition.errors import DataError

    for name in list_driver_names():
        try:
            driver = find_driver(name)
        except DataError as error:  # shown here, and raised again by the command
            emulate.command(name, help=f"{error}.")(_make_command(name, takes_fast=False))
            continue
        if driver.emulate is not None:
            emulate.command(name, help=_format_help(name, driver.title))(_make_command(name, driver.emulates_fast))


def _make_command(name: str, takes_fast: bool) -> Callable[..., None]:
    """Make the command that emulates a driver, with --fast if the driver supports it."""

    def run(**values: Any) -> None:
        _run_emulator(name, EmulateOptions(**values))

    options = inspect.signature(EmulateOptions, eval_str=True).parameters.values()
    run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [option for option in options if takes_fast or option.name != "fast"]
    )
    return run


def _format_help(name: str, title: str) -> str:
    return (
        f"Emulate {title} on a spindle that is hit twice a second. Ctrl-C ends the emulator.\n\nExamples:\n\n"
        f"  lobewatch emulate {name} trial\n  lobewatch tap trial --port /dev/pts/3  # in another window\n"
        f"  lobewatch emulate {name} trial --cut 'A: slot at 12 600 rpm' --depth 2"
    )


def _run_emulator(name: str, options: EmulateOptions) -> None:
    """Emulate tap tests, or a cut if a program was chosen, until Ctrl-C."""
    from acquisition import find_driver
    from lobewatch.machine.folder import MachineFolder
    from lobewatch.tap.emulated_spindle import MountingVariation, WearScenario, build_mounted_spindle

    driver, folder = find_driver(name), MachineFolder(options.machine)
    if folder.machine.spindle is None:
        notes.print(f"{folder.toml} has no [spindle]: the example spindle is emulated", markup=False)
    mounting = MountingVariation(options.scatter / 100, options.bad_clampings / 100, options.temperature)
    mounting.check()
    story, seed, spindle = WearScenario(options.story), options.seed, None
    if story is not WearScenario.NONE or any(mounting):
        spindle = build_mounted_spindle(folder, story, SCENARIO_MONTHS, options.month, mounting, seed)
    shared = {"driver": driver, "folder": folder, "spindle": spindle, "seed": seed}
    shared |= {"realtime": not options.fast, "tcp": options.tcp}
    cut = options.cut
    if options.mass_kg is not None:
        _serve(_emulate_mass(options.mass_kg, cut, shared), options)
    else:
        _serve(_emulate_tap(options, shared) if cut is None else _emulate_cut(options, cut, shared), options)


def _emulate_mass(mass: float, cut: str | None, shared: Mapping[str, Any]) -> Emulation:
    """Emulate hits on a hung mass. `shared` holds the arguments that tap tests take too."""
    if cut is not None:
        raise ValueError("--mass-kg cannot be used with --cut. Leave out one of the two options.")
    from lobewatch.tap.emulated_mass import emulate_mass

    device = emulate_mass(mass=mass, **{key: value for key, value in shared.items() if key != "spindle"})
    return device, {"mass_kg": mass}, f"a mass of {mass:g} kg hangs in its place", "sensors", f" --mass-kg {mass:g}"


def _emulate_tap(options: EmulateOptions, shared: Mapping[str, Any]) -> Emulation:
    """Emulate tap tests. `shared` holds the arguments that a cut takes too."""
    if (options.speed, options.depth) != (None, None):
        raise ValueError("--speed and --depth need a cut. Add --cut PROGRAM.")
    from lobewatch.tap.emulated_faults import EmulatedFault, EmulatedFaults
    from lobewatch.tap.emulated_spindle import emulate_machine

    clock_error = options.clock_error / 100
    faults = EmulatedFaults(EmulatedFault(options.fault), options.turning, options.fault_after, clock_error)
    emulated = emulate_machine(direction=options.direction, axes_angle=options.askew, faults=faults, **shared)
    truth = {"frequency_hz": emulated.frequency, "stiffness_n_per_m": emulated.stiffness}
    text = f"f1 {emulated.frequency:.2f} Hz, stiffness K {emulated.stiffness / 1e6:.3f} N/um"
    words = f" --direction {options.direction}" * (options.direction != "x")
    return emulated.device, truth, text, "tap", words


def _emulate_cut(options: EmulateOptions, program: str, shared: Mapping[str, Any]) -> Emulation:
    """Emulate a cut. `shared` holds the arguments that tap tests take too."""
    if options.direction != "x" or options.askew is not None:
        raise ValueError("--cut cannot be used with --direction and --askew. Leave out --cut, or both others.")
    if options.fault != "none" or options.turning or options.clock_error:
        raise ValueError("--cut cannot be used with --fault, --turning and --clock-error. Leave out --cut.")
    from lobewatch.machine.settings.requested_cut import find_cut_setting
    from lobewatch.tap.emulated_cut import emulate_cut

    setting = find_cut_setting(shared["folder"].machine, program, options.speed, options.depth)
    emulated = emulate_cut(setting=setting, **shared)
    limit = 1e3 * emulated.limit if math.isfinite(emulated.limit) else None
    truth = {"speed_rpm": emulated.speed_rpm, "limit_mm": limit} | emulated.truth.factors
    stable = "any depth" if limit is None else LENGTH.text(limit, ".3g")
    text = f"{emulated.speed_rpm:.1f} rpm, stable up to ap {stable}, cut with ap {LENGTH.text(1e3 * setting.depth)}"
    depth = length_argument(1e3 * setting.depth, "g")
    words = f" --program {shlex.quote(program)} --speed {setting.speed_rpm:g} --depth {depth}"
    return emulated.device, truth, text, "listen", words


def _serve(emulation: Emulation, options: EmulateOptions) -> None:
    """Print the port and the true values, and serve until Ctrl-C."""
    emulator, truth, truth_text, next_command, next_options = emulation
    with emulator as device:
        line = json.dumps({"port": device.port, **truth}) if options.as_json else f"port {device.port}"
        results.print(line, markup=False)
        results.file.flush()
        notes.print(f"true values of the emulated spindle: {truth_text}", markup=False)
        command = f"lobewatch {next_command} {shlex.quote(str(options.machine))} --port {device.port}"
        notes.print(f"Next: {command}{next_options}   (Ctrl-C ends the emulator)", markup=False)
        device.wait()


_add_commands()
