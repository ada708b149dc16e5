"""Device drivers, driver registry and port scan."""

from acquisition.devices.drivers import DeviceSettings, Driver, SensorDataLocation, skip_serial_probe
from acquisition.devices.port_scan import DeviceAnswer, PortScan, ScannedPort, probe_port, scan_ports, search_devices
from acquisition.devices.registry import (
    check_settings,
    convert_driver_errors,
    find_driver,
    list_driver_names,
    load_drivers,
)

__all__ = [
    "DeviceAnswer",
    "DeviceSettings",
    "Driver",
    "PortScan",
    "ScannedPort",
    "SensorDataLocation",
    "check_settings",
    "convert_driver_errors",
    "find_driver",
    "list_driver_names",
    "load_drivers",
    "probe_port",
    "scan_ports",
    "search_devices",
    "skip_serial_probe",
]
