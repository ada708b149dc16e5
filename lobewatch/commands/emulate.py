"""lobewatch emulate."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition import DataError
from lobewatch.emulation import emulated_structure, emulator
from lobewatch.machine_folder import MachineFolder
from lobewatch.output import Json, notes, results

emulate = typer.Typer(help="A data acquisition device made of software, on a pseudo-terminal.", no_args_is_help=True)


@emulate.callback()
def _group() -> None:
    pass


@emulate.command()
def taps(
    machine: Annotated[Path, typer.Argument(help=r"Machine folder with a \[spindle]: what the hammer hits.")],
    tcp: Annotated[bool, typer.Option("--tcp", help="On a TCP port of this computer instead.")] = False,
    fast: Annotated[bool, typer.Option("--fast", help="As fast as the host reads, not in real time.")] = False,
    seed: Annotated[int, typer.Option(help="Of the random numbers.")] = 1,
    as_json: Json = False,
) -> None:
    """A TAPS/1 device with somebody who taps twice a second; Ctrl-C ends it.

    Examples:

      lobewatch emulate taps trial

      lobewatch tap trial --port /dev/pts/3     (in another window)
    """
    folder = MachineFolder(machine)
    spindle = folder.machine.spindle
    if spindle is None:
        raise DataError(f"{folder.toml}: no model to emulate: add a [spindle] table (or use lobewatch init --example)")
    structure = emulated_structure(spindle.build(), spindle.damping_ratio, folder.machine.tap.position_mm / 1e3)
    with emulator(structure, np.random.default_rng(seed), realtime=not fast, tcp=tcp) as device:
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
