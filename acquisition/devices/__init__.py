"""Which device answers on a port."""

from acquisition.devices.probe_port import DeviceIdentity, probe_port

__all__ = [
    "DeviceIdentity",
    "probe_port",
]
