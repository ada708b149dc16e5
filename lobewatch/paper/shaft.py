"""The stand-in for the paper's spindle, whose geometry is not public."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

from dsm import Spindle, Theory
from lobewatch.machine.settings.machine_file import parse_machine


def surrogate(bearing_stiffness: float, theory: Theory = "euler-bernoulli") -> Spindle:
    """The packaged surrogate (26 segments, fitted to the paper's frequencies), each bearing as stiff as given (N/m)."""
    text = resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
    machine = parse_machine(text)
    spindle = machine.model(machine.tap.tool)
    bearings = [replace(bearing, stiffness=bearing_stiffness) for bearing in spindle.bearings]
    return replace(spindle, bearings=bearings, theory=theory)
