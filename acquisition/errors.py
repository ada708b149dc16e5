"""What can go wrong in the world outside: devices and files. Misuse raises the built-in ValueError.

OSError
└── DeviceError     no device, a port in use, an unplugged cable, a device that falls silent
ValueError
└── DataError       a file that cannot be used, with the place and what to do
"""


class DeviceError(OSError):
    """The DAQ cannot be reached or has stopped."""


class DataError(ValueError):
    """A file cannot be used for a tap test."""
