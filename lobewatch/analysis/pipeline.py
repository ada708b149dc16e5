"""From one tap test to one measurement: modes, bearing stiffness, stability lobes. A step that cannot be done is
recorded with its reason, and the pipeline goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from acquisition import TapTest, joined, stiffness_doubt
from dsm import Calibration, calibrate, modal_stiffness
from lobes import StabilityLobes, zero_order
from lobewatch.machine.machine_file import Machine
from modal import Mode, fit_modes, follow, predominant


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Modes of one tap test and the model recalibrated to them."""

    modes: Sequence[Mode]
    """All modes found, as measured."""
    followed: Mode | None
    """The mode that calibration and trend follow."""
    calibration: Calibration | None
    """The recalibrated model."""
    at_tip: Sequence[Mode]
    """The modes that lobes are computed from, at the tool tip; empty where there are none."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """What one tap test says of the spindle."""

    tap_id: str
    """Of the tap test."""
    time: datetime
    """When it was taken."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    dynamics: Dynamics
    """Modes and model."""
    lobes: Mapping[str, StabilityLobes]
    """Stability lobes by name of the cut."""
    notes: Sequence[str]
    """What could not be done, and why."""
    x: Sequence[Mode] | None = None
    """Modes at the tool tip in the feed direction that lobes are computed from; None where there are none."""
    y: Sequence[Mode] | None = None
    """The same normal to the feed."""
    predicted: bool = False
    """Whether all of it comes from the model, for a tool that was never tapped."""

    @property
    def reasons(self) -> list[str]:
        """The notes but for those on the lobes of single cuts."""
        return [note for note in self.notes if note not in _warnings(self.lobes)]


def analyse(tap: TapTest, machine: Machine, partner: TapTest | None = None, last: Mode | None = None) -> Measurement:
    """All that follows from a tap test; partner: the one in the other direction with the same tool, within a day;
    last: the mode that was followed in the test before."""
    notes: list[str] = []
    about = tap.circumstances
    with threadpool_limits(limits=1):
        seen = _dynamics(tap, machine, notes, last)
        other = _dynamics(partner, machine, []).at_tip if partner is not None else []
        lobes = _lobes(seen.at_tip, other, tap, machine, notes)
    x, y = (seen.at_tip, other) if about.direction == "x" else (other, seen.at_tip)
    return Measurement(tap.id, about.created, about.tool, about.direction, seen, lobes, notes, x or None, y or None)


def speed_grid(machine: Machine) -> NDArray[np.float64]:
    """The common speeds of all diagrams of a machine (rpm), shape ([speed] steps,)."""
    return np.linspace(machine.speed.low_rpm, machine.speed.high_rpm, machine.speed.steps)


def _in_band(modes: Sequence[Mode], machine: Machine) -> list[Mode]:
    low, high = machine.mode.band_hz or (0.0, np.inf)
    return [mode for mode in modes if low <= mode.frequency <= high]


def _no_mode(modes: Sequence[Mode], machine: Machine) -> str:
    low, high = machine.mode.band_hz or (0.0, np.inf)
    place = "" if machine.mode.band_hz is None else f" in [mode] band_hz {low:g}..{high:g} Hz"
    found = f"found are {', '.join(f'{mode.frequency:.0f}' for mode in modes)} Hz" if modes else "none was found at all"
    return f"no mode to follow: none with positive stiffness{place}; {found}"


def _dynamics(tap: TapTest, machine: Machine, notes: list[str], last: Mode | None = None) -> Dynamics:
    try:
        modes = fit_modes(tap.frf, hits=tap.accepted)
    except ValueError as error:
        notes.append(f"no modes: {error}")
        return Dynamics([], None, None, [])
    followed = _follow(modes, machine, notes, last)
    if followed is not None:
        doubt = stiffness_doubt(followed.stiffness)
        notes.extend([] if doubt is None else [str(doubt)])
    calibration = _calibrate(followed, machine, tap.circumstances.tool, notes)
    return Dynamics(modes, followed, calibration, _modes_at_tip(modes, followed, calibration, machine, notes))


def _follow(modes: Sequence[Mode], machine: Machine, notes: list[str], last: Mode | None) -> Mode | None:
    """The mode that continues the last one, the predominant one where there is none yet."""
    first = predominant(modes, machine.mode.band_hz)
    if first is None:
        notes.append(_no_mode(modes, machine))
        return None
    if last is None:
        return first
    found = follow(last, _in_band(modes, machine))
    if found.mode is None:
        notes.append(f"no mode to follow: {found.doubt}; for a rebuilt spindle lay [mode] band_hz around its new mode")
    elif found.doubt:
        notes.append(found.doubt)
    return found.mode


def _calibrate(followed: Mode | None, machine: Machine, tool: str, notes: list[str]) -> Calibration | None:
    if followed is None:
        return None
    std = float(followed.standard_error[0])
    try:
        spindle = machine.model(tool)
        return calibrate(spindle, followed.frequency, std if np.isfinite(std) else None, machine.mode.model_mode)
    except (ValueError, ArithmeticError) as error:
        notes.append(f"no bearing stiffness: {error}")
        return None


def _modes_at_tip(
    modes: Sequence[Mode],
    followed: Mode | None,
    calibration: Calibration | None,
    machine: Machine,
    notes: list[str],
) -> list[Mode]:
    """Modes in the band, carried to the tip by the model where the tap was elsewhere; none where K < 0."""
    candidates = _in_band(modes, machine)
    against = [mode for mode in candidates if not mode.is_driving_point]
    if not any(mode.is_driving_point for mode in candidates):
        return []
    if against:
        where = ", ".join(f"{mode.frequency:.0f}" for mode in against)
        notes.append(
            f"no stability lobes: not a driving point, the stiffness of the modes at {where} Hz is negative; hit and "
            "measure at one point in one direction, or leave these modes out with [mode] band_hz"
        )
        return []
    if machine.tap.position_mm == 0:
        return candidates
    if calibration is None or followed is None:
        notes.append(
            "no stability lobes: the tap was not at the tool tip ([tap] position_mm), and there is no calibrated model"
        )
        return []
    return [_carried_to_tip(followed, calibration, machine.tap.position_mm / 1e3)]


def _carried_to_tip(mode: Mode, calibration: Calibration, position: float) -> Mode:
    number = calibration.mode
    ratio = modal_stiffness(calibration.spindle, number) / modal_stiffness(calibration.spindle, number, position)
    return mode.scaled(1.0, ratio, "model to tip")


def _lobes(
    at_tip: Sequence[Mode], other: Sequence[Mode], tap: TapTest, machine: Machine, notes: list[str]
) -> dict[str, StabilityLobes]:
    if not at_tip:
        return {}
    direction = tap.circumstances.direction
    if not other:
        notes.append(f"stability lobes in the {direction} direction alone: the other one was not tapped within a day")
    x, y = (at_tip, other) if direction == "x" else (other, at_tip)
    return lobes_of(x or None, y or None, tap.circumstances.tool, machine, notes)


def lobes_of(
    x: Sequence[Mode] | None, y: Sequence[Mode] | None, tool: str, machine: Machine, notes: list[str]
) -> dict[str, StabilityLobes]:
    """Stability lobes by zero order for the reference cut and every program of a tool; warnings go to the notes."""
    cuts = machine.cuts(tool)
    if not cuts:
        notes.append("no stability lobes: no [reference_cut] and no [[program]] in machine.toml")
    lobes = {name: zero_order(x, y, cut, speed_grid(machine)) for name, cut in cuts.items()}
    notes.extend(_warnings(lobes))
    return lobes


def _warnings(lobes: Mapping[str, StabilityLobes]) -> list[str]:
    """What speaks against the method, with the cuts that it concerns."""
    found = joined(replace(remark, about=name) for name, one in lobes.items() for remark in one.remarks)
    return [str(remark) for remark in found]
