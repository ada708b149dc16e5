"""One tap test or one recorded file to what it measures: modes, followed mode, calibrated model; questions; workers."""

from .estimate import Estimate
from .measurement import Measurement, measure
from .model import (
    ModelMode,
    ModelState,
    ModelSummary,
    first_critical_speed,
    model_frf,
    model_state,
    model_summary,
)
from .model_calibration import ModelCalibration, calibrate_model
from .one_file.beside import found_beside, places_beside
from .one_file.file_modes import FileModes, modes_of_file, remarks_on_all
from .one_file.windows import Window

__all__ = [
    "Estimate",
    "FileModes",
    "Measurement",
    "ModelCalibration",
    "ModelMode",
    "ModelState",
    "ModelSummary",
    "Window",
    "calibrate_model",
    "first_critical_speed",
    "found_beside",
    "measure",
    "model_frf",
    "model_state",
    "model_summary",
    "modes_of_file",
    "places_beside",
    "remarks_on_all",
]
