"""lobewatch emulate."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition import DataError, DataqEmulator, Structure, TapsEmulator
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, notes, results
from lobewatch.tap.emulated_spindle import dataq_emulator, emulated_structure, emulator

emulate = typer.Typer(help="A data acquisition device made of software, on a pseudo-terminal.", no_args_is_help=True)


Machine = Annotated[
    Path, typer.Argument(parser=named_folder, help="Machine folder with a [spindle]: what the hammer hits.")
]
Tcp = Annotated[bool, typer.Option("--tcp", help="On a TCP port of this computer instead.")]
Fast = Annotated[bool, typer.Option("--fast", help="As fast as the host reads, not in real time.")]
Seed = Annotated[int, typer.Option(help="Of the random numbers.")]


@emulate.command()
def taps(machine: Machine, tcp: Tcp = False, fast: Fast = False, seed: Seed = 1, as_json: Json = False) -> None:
    """A TAPS/1 device with somebody who taps twice a second; Ctrl-C ends it.

    Examples:

      lobewatch emulate taps trial
      lobewatch tap trial --port /dev/pts/3  # in another window
    """
    structure = _structure(MachineFolder(machine))
    _serve(emulator(structure, np.random.default_rng(seed), realtime=not fast, tcp=tcp), structure, machine, as_json)


@emulate.command()
def dataq(machine: Machine, tcp: Tcp = False, seed: Seed = 1, as_json: Json = False) -> None:
    """A DATAQ DI-4108 with the sensors of [[daq.channel]] and somebody who taps twice a second; Ctrl-C ends it.

    Examples:

      lobewatch emulate dataq trial
      lobewatch tap trial --port /dev/pts/3  # in another window
    """
    folder = MachineFolder(machine)
    structure = _structure(folder)
    inputs = tuple(channel.build() for channel in folder.machine.daq.channel)
    if not inputs:
        raise DataError(
            f'{folder.toml}: no sensors to emulate: give driver = "dataq" in [daq] and two [[daq.channel]] '
            "(docs/devices.md shows them)"
        )
    random = np.random.default_rng(seed)
    _serve(dataq_emulator(structure, inputs, random, realtime=True, tcp=tcp), structure, machine, as_json)


def _structure(folder: MachineFolder) -> Structure:
    spindle = folder.machine.spindle
    if spindle is None:
        raise DataError(f"{folder.toml}: no model to emulate: add a [spindle] table (or use lobewatch init --example)")
    return emulated_structure(spindle.build(), spindle.damping_ratio, folder.machine.tap.position_mm / 1e3)


def _serve(device: TapsEmulator | DataqEmulator, structure: Structure, machine: Path, as_json: bool) -> None:
    """Say where it is, and serve until Ctrl-C."""
    with device:
        first = {"frequency_hz": structure.frequency[0], "stiffness_n_per_m": structure.stiffness[0]}
        if as_json:
            results.print(json.dumps({"port": device.port, **first}), markup=False)
        else:
            results.print(f"port {device.port}", markup=False)
        results.file.flush()
        notes.print(f"the truth: f_1 {first['frequency_hz']:.2f} Hz, K {first['stiffness_n_per_m'] / 1e6:.3f} N/um")
        notes.print(
            f"tap with: lobewatch tap {shlex.quote(str(machine))} --port {device.port}   (Ctrl-C ends the emulator)"
        )
        device.wait()
