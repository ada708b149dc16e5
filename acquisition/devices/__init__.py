"""The drivers there are, and which device answers on a port."""

from acquisition.devices.check_settings import check_settings
from acquisition.devices.driver import DeviceSettings, Driver, SensorPlace, on_no_serial_port
from acquisition.devices.probe_port import Answer, probe_port
from acquisition.devices.registry import driver_names, find_driver, load_drivers, named_package
from acquisition.devices.search_devices import search_devices
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
    "on_no_serial_port",
    "probe_port",
    "search_devices",
    "survey_ports",
]
