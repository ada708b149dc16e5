"""Whether hammer, accelerometer and DAQ of a machine are right: what is plugged in, a hung mass, a common signal."""

from lobewatch.sensors.list_sensors import SensorList, list_sensors
from lobewatch.sensors.mass_check import MassCheck, check_mass
from lobewatch.sensors.skew_check import SkewCheck, check_skew

__all__ = [
    "MassCheck",
    "SensorList",
    "SkewCheck",
    "check_mass",
    "check_skew",
    "list_sensors",
]
