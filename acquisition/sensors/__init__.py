"""Checks of hammer, accelerometer and DAQ: sample rate, channel skew, mass calibration, plausibility."""

from acquisition.sensors.daq_timing import (
    MeasuredRate,
    MeasuredSkew,
    check_rate,
    measure_rate,
    measure_skew,
    rate_remark,
)
from acquisition.sensors.mass_calibration import MAX_SENSITIVITY_DEVIATION, MassCalibration, calibrate_by_mass
from acquisition.sensors.plausibility import calibration_remark, channel_remarks, stiffness_remark, unit_mistake_remark

__all__ = [
    "MAX_SENSITIVITY_DEVIATION",
    "MassCalibration",
    "MeasuredRate",
    "MeasuredSkew",
    "calibrate_by_mass",
    "calibration_remark",
    "channel_remarks",
    "check_rate",
    "measure_rate",
    "measure_skew",
    "rate_remark",
    "stiffness_remark",
    "unit_mistake_remark",
]
