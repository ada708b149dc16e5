"""Advice for cutting programs: lobes joined with the machine file and, for what is hypothetical, with the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError
from dsm import Calibration, calibrate
from lobes import (
    Program,
    ProgramCheck,
    StabilityLobes,
    aged_mode,
    check_program,
    measurement_band,
    stability_boundary,
    tolerable_decay,
)
from lobewatch.analysis.history import measure
from lobewatch.analysis.pipeline import Measurement, speed_grid
from lobewatch.analysis.prediction import predict
from lobewatch.machine.cut_tables import ProgramTable
from lobewatch.machine.drive import drive_limit
from lobewatch.machine.folder import MachineFolder, TapEntry
from lobewatch.machine.machine_file import Machine
from modal import Mode

PATIENCE = 5.0
"""Time after which a person is told how far it is (s)."""
FALLS = np.array([0.0, 0.05, 0.10, 0.15, 0.20])
"""Falls of the frequency for which the model is recalibrated; between them its stiffness is interpolated."""

Modes = Sequence[Mode] | None
ModesAt = Callable[[float], tuple[Modes, Modes]]


@dataclass(frozen=True)
class ProgramAdvice:
    """What a programmer should know of one program."""

    table: ProgramTable
    """The program as it stands in machine.toml."""
    tap_id: str
    """The tap test that it was checked with; "" where there is none with its tool."""
    check: ProgramCheck | None
    """State, margins, nearest speed; None where it could not be checked."""
    limit_band: tuple[float, float]
    """95 % band of the limit from the covariance of the modes (m); NaN where they have none."""
    measured: bool
    """Whether its tool was tapped; else all is predicted by the model."""
    decay: float
    """Tolerable fall of the frequency, relative; inf where nothing happens down to 80 %."""
    was_stable: bool | None
    """Whether it was stable on the first spindle tapped with this tool and direction; None where the modes of then and
    now are not of the same directions."""
    drive_limit: float
    """Deepest cut that power and torque allow at its speed (m); inf where no limit is known."""
    notes: tuple[str, ...]
    """Assumptions, and why something is missing."""


def advise(folder: MachineFolder, tell: Callable[[str], None] = lambda _: None) -> list[ProgramAdvice]:
    """Advice for every program of a machine, from the newest tap test with its tool; tell: hears how far it is."""
    taps, programs = folder.taps(), folder.machine.program
    measured: dict[str, Measurement] = {}
    found: list[ProgramAdvice] = []
    begin, told = monotonic(), False
    for table in programs:
        if not told and monotonic() - begin > PATIENCE:
            tell(f"{len(found)} of {len(programs)} programs are checked; the others take a while too")
            told = True
        of_tool = [tap for tap in taps if tap.tool == table.tool]
        if not of_tool:
            found.append(_predicted(table, folder))
            continue
        for tap in (of_tool[-1], _first(of_tool)):
            measured.setdefault(tap.id, measure(folder, tap))
        now, then = measured[of_tool[-1].id], measured[_first(of_tool).id]
        if now.dynamics.at_tip:
            found.append(_advise(table, folder.machine, now, then))
        else:
            found.append(_unknown(table, now.tap_id, "; ".join(now.notes)))
    return found


def _predicted(table: ProgramTable, folder: MachineFolder) -> ProgramAdvice:
    """Advice for a program whose tool was never tapped, from the model where there is one."""
    try:
        prediction = predict(folder, table.tool)
    except DataError as error:
        return _unknown(table, "", f"no tap test with tool {table.tool!r}, and no prediction: {error}")
    return _advise(table, folder.machine, prediction, prediction)


def aging(measurement: Measurement) -> tuple[ModesAt, str]:
    """The modes of a measurement as functions of a frequency ratio, all falling alike, and the assumption in words.

    K follows the model (bearings softer until its frequency has fallen as far); without a model it stays.
    """
    calibration = measurement.dynamics.calibration
    ratios = np.ones(1)
    if calibration is not None:
        ratios = _stiffness_ratios(calibration)

    def modes_at(ratio: float) -> tuple[Modes, Modes]:
        softer = float(np.interp(1 - ratio, FALLS[: ratios.size], ratios)) if ratios.size > 1 else None
        x, y = (
            [aged_mode(mode, ratio, "model", softer) for mode in modes] if modes else None
            for modes in (measurement.x, measurement.y)
        )
        return x, y

    said = "K does not (no model)"
    if ratios.size > 1:
        fall, change = 100 * FALLS[ratios.size - 1], 100 * (ratios[-1] - 1)
        said = f"K changes as in the model ({change:+.1f} % when f_n has fallen by {fall:.0f} %)"
    return modes_at, f"decay left: all modes fall alike, zeta does not change, {said}"


def _stiffness_ratios(calibration: Calibration) -> NDArray[np.float64]:
    """Modal stiffness at the tip for each of FALLS over that for none, as far as softer bearings can bring about."""
    stiffness: list[float] = []
    for fall in FALLS:
        try:
            softer = calibrate(calibration.spindle, calibration.frequency * (1 - fall), mode=calibration.mode)
            stiffness.append(softer.modal_stiffness_after)
        except (ValueError, ArithmeticError):
            break
    return np.array(stiffness or [1.0]) / (stiffness or [1.0])[0]


def _first(taps: Sequence[TapEntry]) -> TapEntry:
    """The first tap in the direction of the newest."""
    return next(tap for tap in taps if tap.direction == taps[-1].direction)


def _unknown(table: ProgramTable, tap_id: str, reason: str) -> ProgramAdvice:
    nan = float("nan")
    return ProgramAdvice(table, tap_id, None, (nan, nan), False, nan, False, float("inf"), (f"not checked: {reason}",))


def _advise(table: ProgramTable, machine: Machine, now: Measurement, then: Measurement) -> ProgramAdvice:
    program = _program(table, machine)
    speeds = speed_grid(machine)
    check = check_program(program, now.x, now.y, speeds, drive_limit(machine, table, speeds))
    modes_at, assumption = aging(now)
    allowed = float(drive_limit(machine, table, np.array([table.speed_rpm]))[0])
    return ProgramAdvice(
        table=table,
        tap_id=now.tap_id,
        check=check,
        limit_band=_band(program, now, check),
        measured=not now.predicted,
        decay=tolerable_decay(program, modes_at) if check.stable else 0.0,
        was_stable=_was_stable(program, now, then),
        drive_limit=allowed,
        notes=(*([assumption] if check.stable else []), *_remarks(table, machine, now)),
    )


def _remarks(table: ProgramTable, machine: Machine, now: Measurement) -> Iterator[str]:
    if now.predicted:
        yield from now.notes[:1]
    if not (now.x and now.y):
        yield f"modes in the {now.direction} direction alone"
    if min(machine.drive.power_kw, machine.drive.torque_nm) < np.inf and table.feed_per_tooth_mm is None:
        yield "[drive] does not count: feed_per_tooth_mm is missing"


def _was_stable(program: Program, now: Measurement, then: Measurement) -> bool | None:
    if (bool(now.x), bool(now.y)) != (bool(then.x), bool(then.y)):
        return None
    return _is_stable(program, then)


def _is_stable(program: Program, measurement: Measurement) -> bool:
    x, y = measurement.x, measurement.y
    return bool(stability_boundary(x, y, program.cut, program.speed_rpm, program.depth).depth[0] == np.inf)


def unstable_programs(measurement: Measurement, machine: Machine) -> list[str]:
    """Names of the programs with lobes in this measurement that are not stable; the method is that of `advise`."""
    return [
        table.name
        for table in machine.program
        if table.name in measurement.lobes and not _is_stable(_program(table, machine), measurement)
    ]


def _program(table: ProgramTable, machine: Machine) -> Program:
    return Program(machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)


def _limits(program: Program, x: Modes, y: Modes) -> StabilityLobes:
    return stability_boundary(x, y, program.cut, program.speed_rpm, 20 * program.depth)


def _band(program: Program, measurement: Measurement, check: ProgramCheck) -> tuple[float, float]:
    if not np.isfinite(check.limit):
        return check.limit, check.limit
    if all(mode.best_covariance is None for mode in (*(measurement.x or ()), *(measurement.y or ()))):
        return float("nan"), float("nan")
    band = measurement_band(lambda x, y: _limits(program, x, y), measurement.x, measurement.y)
    return float(band.low[0]), float(band.high[0])
