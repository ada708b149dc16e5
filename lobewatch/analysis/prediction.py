"""One tap, every tool: what the calibrated model says of a tool that was never tapped."""

from __future__ import annotations

import numpy as np

from acquisition import DataError, Remark
from dsm import calibrate, modes_at
from lobewatch.analysis.assembly import Assembly
from lobewatch.analysis.measurement import Measurement
from lobewatch.analysis.model_state import model_state
from lobewatch.machine import Machine
from modal import Mode

MODES = 8
"""Modes worked out; those in which the tip is next to at rest are left out."""
AT_REST = 50.0
"""A mode so many times stiffer at the tip than the softest one does not move a limit by more than a few percent."""


def predict(machine: Machine, newest: Measurement | None, tool: str) -> Assembly:
    """A tool as the model with the bearings of the newest calibrated measurement has it, both directions alike.

    The shaft is round and its bearings are as stiff in all directions, whatever direction was tapped; the damping ratio
    is that of the measured mode. No standard errors: the error of the model itself is not known. DataError where there
    is no model of the tool, or no tap test that the bearings could be found from.
    """
    state = model_state(machine, newest, tool)
    if newest is None or newest.followed is None:
        raise DataError(f"tool {tool!r} was never tapped, and no tap test has set the bearings of the model yet")
    frequency, stiffness = modes_at(state.spindle, MODES)
    softest = int(np.argmin(stiffness))
    modes = [
        Mode(f, newest.followed.damping_ratio, k, method=f"model, bearings of {newest.tap_id}")
        for f, k in zip(frequency.tolist(), stiffness.tolist(), strict=True)
        if k < AT_REST * stiffness[softest]
    ]
    text = f"predicted, not measured: model with the bearings of {newest.tap_id}, x and y alike"
    return Assembly(
        tool=tool,
        time=newest.time,
        tap_id=f"prediction from {newest.tap_id}",
        x=modes,
        y=modes,
        calibration=calibrate(state.spindle, float(frequency[softest]), mode=softest + 1),
        taps={},
        predicted=True,
        remarks=(Remark("predicted", f"tool {tool!r}", text, "tap it to be sure"),),
    )
