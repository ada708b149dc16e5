"""Whether hammer, accelerometer and DAQ are right: rate, skew, mass calibration, plausibility."""

from acquisition.sensors.mass_calibration import AGREES, MassCalibration, calibrate_by_mass
from acquisition.sensors.measure_rate import MeasuredRate, check_rate, measure_rate, rate_doubt
from acquisition.sensors.measure_skew import MeasuredSkew, measure_skew
from acquisition.sensors.plausibility import calibration_doubt, channel_doubts, stiffness_doubt, unit_mistake

__all__ = [
    "AGREES",
    "MassCalibration",
    "MeasuredRate",
    "MeasuredSkew",
    "calibrate_by_mass",
    "calibration_doubt",
    "channel_doubts",
    "check_rate",
    "measure_rate",
    "measure_skew",
    "rate_doubt",
    "stiffness_doubt",
    "unit_mistake",
]
