"""Checks of sensors, DAQ and computer before a tap test."""

from lobewatch.sensors.computer_check import Finding, check_computer
from lobewatch.sensors.sensor_checks import MassCheck, SensorList, SkewCheck, check_mass, check_skew, list_sensors

__all__ = [
    "Finding",
    "MassCheck",
    "SensorList",
    "SkewCheck",
    "check_computer",
    "check_mass",
    "check_skew",
    "list_sensors",
]
