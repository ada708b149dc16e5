"""Prediction of an untapped tool by the calibrated model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition import DataError, Remark
from dsm import Calibration, calibrate, modes_at
from lobewatch.machine import Machine
from lobewatch.measurement.spindle_model import build_model_state
from lobewatch.measurement.tap_measurement import Measurement
from lobewatch.tool.assembly import Assembly, make_assembly, untapped_remark
from lobewatch.tool.principal_directions import TipModes
from modal import Mode

PREDICTED_MODE_COUNT = 8
"""Number of computed modes."""
MAX_PREDICTED_STIFFNESS_RATIO = 50.0
"""Stiffness over that of the softest mode above which a mode changes limits by only a few percent and is left out."""


def predict_assembly(machine: Machine, newest: Sequence[Measurement], tool: str) -> Assembly:
    """Predict a tool in each direction, with the bearings of the newest calibrated measurement.

    newest: those measurements, newest first. The damping ratio is that of the followed mode, and so is the phase of the
    softest mode, since the same bearings and joints damp it. Raises DataError without a model of the tool or a tap
    test.
    """
    if not newest:
        build_model_state(machine, None, tool)
        raise DataError(f"tool {tool!r} was never tapped, and no tap test has set the bearings of the model yet")
    predictions = {tap.direction: _predict_direction(machine, tap, tool) for tap in newest}
    modes: dict[str, TipModes] = {direction: at_tip for direction, (at_tip, _) in predictions.items()}
    ids = " and ".join(tap.tap_id for tap in newest)
    remark = Remark("predicted", f"tool {tool!r}", f"predicted by the model with the bearings of {ids}", "tap it")
    name, calibration = f"prediction from {newest[0].tap_id}", predictions[newest[0].direction][1]
    assembly = make_assembly(tool, newest[0].time, name, modes, calibration)
    tapped = assembly.directions
    return replace(assembly, remarks=(remark, *([untapped_remark(tool, tapped[0])] if len(tapped) == 1 else [])))


def _predict_direction(machine: Machine, tap: Measurement, tool: str) -> tuple[list[Mode], Calibration]:
    """Return the modes of the model in the measured band, shifted with the softest one."""
    state, followed = build_model_state(machine, tap, tool), tap.followed
    if followed is None:
        raise DataError(f"{tap.tap_id}: no mode is followed")
    frequency, stiffness = modes_at(state.spindle, PREDICTED_MODE_COUNT)
    softest = int(np.argmin(stiffness))
    shown = stiffness < MAX_PREDICTED_STIFFNESS_RATIO * stiffness[softest]
    if machine.mode.band_hz is not None:
        low, high = (edge / followed.frequency * frequency[softest] for edge in machine.mode.band_hz)
        shown &= (frequency >= low) & (frequency <= high)
    origin = f"model, bearings of {tap.tap_id}"
    modes = list[Mode]()
    for i in np.flatnonzero(shown).tolist():
        phase = followed.phase_deg if i == softest else 0.0
        values = float(frequency[i]), followed.damping_ratio, float(stiffness[i])
        modes.append(Mode(*values, method=origin, phase_deg=phase))
    return modes, calibrate(state.spindle, float(frequency[softest]), mode=softest + 1)
