"""One tool in the spindle as it is known at some time: the newest tap in x and the newest in y, or a prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from dsm import Calibration
from lobes import StabilityLobes, zero_order
from lobewatch.analysis.measurement import Measurement
from lobewatch.machine import Machine
from modal import Mode

Modes = Sequence[Mode] | None
"""Of one direction at the tool tip; None where they are not known."""
ABOUT_DIRECTIONS = ("one-direction", "older-direction")
"""Codes of the remarks on what is known in x and y."""
TOGETHER = timedelta(hours=24)
"""Taps in x and y further apart than this are called so."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """What lobes and verdicts of one tool are computed from."""

    tool: str
    """What is in the spindle."""
    time: datetime
    """Of its newest tap test; of the one that the bearings come from where it is predicted."""
    tap_id: str
    """Of the same, or where the prediction comes from."""
    x: Modes
    """At the tool tip in the feed direction."""
    y: Modes
    """The same normal to the feed."""
    calibration: Calibration | None
    """The model with the newest bearings."""
    taps: Mapping[str, str]
    """Tap test by direction; empty where it is predicted."""
    predicted: bool
    """Whether all of it comes from the model, for a tool that was never tapped."""
    remarks: tuple[Remark, ...]
    """What is not known, and what is in doubt."""

    @property
    def directions(self) -> tuple[str, ...]:
        """Those that are known."""
        return tuple(name for name, modes in (("x", self.x), ("y", self.y)) if modes)

    @property
    def label(self) -> str:
        """What a legend says."""
        return f"predicted, bearings of {self.time:%Y-%m-%d}" if self.predicted else f"{self.time:%Y-%m-%d}"


def assemble(newest: Measurement, other: Measurement | None) -> Assembly:
    """From the newest tap test of a tool and the newest one in the other direction, however old, where there is one."""
    seen = [newest, *([other] if other is not None else [])]
    modes: dict[str, Modes] = {one.direction: one.at_tip or None for one in seen}
    calibration = next((one.calibration for one in seen if one.calibration is not None), None)
    return Assembly(
        tool=newest.tool,
        time=newest.time,
        tap_id=newest.tap_id,
        x=modes.get("x"),
        y=modes.get("y"),
        calibration=calibration,
        taps={one.direction: one.tap_id for one in seen},
        predicted=False,
        remarks=(*newest.remarks, *_about_directions(newest, other)),
    )


def _about_directions(newest: Measurement, other: Measurement | None) -> tuple[Remark, ...]:
    known = [one for one in (newest, other) if one is not None and one.at_tip]
    if len(known) == 1:
        missing = "y" if known[0].direction == "x" else "x"
        text = f"modes in the {known[0].direction} direction alone"
        return (Remark("one-direction", newest.tool, text, f"tap direction {missing} of the same tool too"),)
    if other is not None and newest.time - other.time > TOGETHER:
        days = round((newest.time - other.time) / timedelta(days=1))
        older = f"{days} day{'s' if days > 1 else ''} older"
        text = f"direction {other.direction} is that of {other.time:%Y-%m-%d}, {older}"
        return (Remark("older-direction", newest.tool, text, f"tap direction {other.direction} again"),)
    return ()


def speed_grid(machine: Machine) -> NDArray[np.float64]:
    """The common speeds of all diagrams of a machine (rpm), shape ([speed] steps,)."""
    return np.linspace(machine.speed.low_rpm, machine.speed.high_rpm, machine.speed.steps)


def lobes_of(assembly: Assembly, machine: Machine) -> dict[str, StabilityLobes]:
    """Diagrams by zero order, by name of the cut: the reference cut and every program of the tool. A chart, no verdict.

    Empty where no modes are known.
    """
    if not assembly.directions:
        return {}
    speeds = speed_grid(machine)
    return {name: zero_order(assembly.x, assembly.y, cut, speeds) for name, cut in machine.cuts(assembly.tool).items()}
