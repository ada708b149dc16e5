"""Measurement of one tap test or recorded file: modes, followed mode, calibrated model, questions."""

from .estimate import Estimate
from .exponential_window import Window
from .file_modes import FileModes, check_modes_together, fit_file_modes, list_comparison_files, match_modes_across_files
from .folder_shapes import FolderShapes, MeasuredPoint, PointCheck, compare_shapes, measure_folder_shapes
from .spindle_model import (
    ModelCalibration,
    ModelMode,
    ModelState,
    ModelSummary,
    build_model_state,
    calibrate_model,
    compute_model_frf,
    first_critical_speed,
    summarize_model,
)
from .tap_measurement import Measurement, measure

__all__ = [
    "Estimate",
    "FileModes",
    "FolderShapes",
    "MeasuredPoint",
    "Measurement",
    "ModelCalibration",
    "ModelMode",
    "ModelState",
    "ModelSummary",
    "PointCheck",
    "Window",
    "build_model_state",
    "calibrate_model",
    "check_modes_together",
    "compare_shapes",
    "compute_model_frf",
    "first_critical_speed",
    "fit_file_modes",
    "list_comparison_files",
    "match_modes_across_files",
    "measure",
    "measure_folder_shapes",
    "summarize_model",
]
