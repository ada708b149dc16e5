"""Whether hammer, accelerometer, DAQ and computer are right: a look at them, a hung mass, a common signal."""

from lobewatch.sensors.examine_computer import Finding, examine_computer
from lobewatch.sensors.list_sensors import SensorList, list_sensors
from lobewatch.sensors.mass_check import MassCheck, check_mass
from lobewatch.sensors.skew_check import SkewCheck, check_skew

__all__ = [
    "Finding",
    "MassCheck",
    "SensorList",
    "SkewCheck",
    "check_mass",
    "check_skew",
    "examine_computer",
    "list_sensors",
]
