"""Stiffness and damping of bearings and joints from measured modes."""

from dsm.calibration.calibrate import calibrate
from dsm.calibration.calibrate_damping import DampingCalibration, UnreachableDampingError, calibrate_damping
from dsm.calibration.calibration import Calibration, UnreachableFrequencyError
from dsm.calibration.fit_stiffness import fit_stiffness
from dsm.calibration.plus_minus import plus_minus
from dsm.calibration.predict_mode import PredictedMode, predict_mode
from dsm.calibration.preload_left import PreloadLeft, preload_left
from dsm.calibration.receptance_map import receptance_map
from dsm.calibration.stiffness_curve import stiffness_curve
from dsm.calibration.stiffness_fit import StiffnessFit, StiffnessFitError

__all__ = [
    "Calibration",
    "DampingCalibration",
    "PredictedMode",
    "PreloadLeft",
    "StiffnessFit",
    "StiffnessFitError",
    "UnreachableDampingError",
    "UnreachableFrequencyError",
    "calibrate",
    "calibrate_damping",
    "fit_stiffness",
    "plus_minus",
    "predict_mode",
    "preload_left",
    "receptance_map",
    "stiffness_curve",
]
