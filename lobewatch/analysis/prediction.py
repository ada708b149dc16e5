"""One tap, every tool: what the calibrated model says of a tool that was never tapped."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from acquisition import DataError
from dsm import calibrate, modes_at
from lobewatch.analysis.model_state import model_state
from lobewatch.analysis.pipeline import Dynamics, Measurement, lobes_of
from lobewatch.machine.folder import MachineFolder
from modal import Mode

MODES = 8
"""Modes worked out; those in which the tip is next to at rest are left out."""
AT_REST = 50.0
"""A mode so many times stiffer at the tip than the softest one does not move a limit by more than a few percent."""


def predict(folder: MachineFolder, tool: str) -> Measurement:
    """A tool as the model with the bearings of the newest tap test has it, both directions alike.

    The shaft is round and its bearings are as stiff in all directions, whatever direction was tapped; the damping ratio
    is that of the measured mode. No standard errors: the error of the model itself is not known. DataError where there
    is no model of the tool, or no tap test that the bearings could be found from.
    """
    state = model_state(folder, tool)
    followed, newest = state.followed, state.tap
    if followed is None or newest is None:
        raise DataError(f"tool {tool!r} was never tapped, and no tap test has set the bearings of the model yet")
    frequency, stiffness = modes_at(state.spindle, MODES)
    softest = int(np.argmin(stiffness))
    modes = [
        Mode(f, followed.damping_ratio, k, method=f"model, bearings of {newest.id}")
        for f, k in zip(frequency.tolist(), stiffness.tolist(), strict=True)
        if k < AT_REST * stiffness[softest]
    ]
    notes = [f"tool {tool!r} is predicted, not measured: model with the bearings of {newest.id}, x and y alike"]
    calibration = calibrate(state.spindle, float(frequency[softest]), mode=softest + 1)
    lobes = lobes_of(modes, modes, tool, folder.machine, notes)
    return Measurement(
        tap_id=f"prediction from {newest.id}",
        time=datetime.fromisoformat(newest.time),
        tool=tool,
        direction="x",
        dynamics=Dynamics(modes, modes[0], calibration, modes),
        lobes=lobes,
        notes=notes,
        x=modes,
        y=modes,
        predicted=True,
    )
