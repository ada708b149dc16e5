"""The drivers there are, and which device answers on a port."""

from acquisition.devices.check_settings import check_settings
from acquisition.devices.driver import DeviceSettings, Driver, SensorPlace
from acquisition.devices.probe_port import Answer, probe_port
from acquisition.devices.registry import driver_names, find_driver, load_drivers, named_package
from acquisition.devices.survey_ports import PortSurvey, SeenPort, survey_ports

__all__ = [
    "Answer",
    "DeviceSettings",
    "Driver",
    "PortSurvey",
    "SeenPort",
    "SensorPlace",
    "check_settings",
    "driver_names",
    "find_driver",
    "load_drivers",
    "named_package",
    "probe_port",
    "survey_ports",
]
