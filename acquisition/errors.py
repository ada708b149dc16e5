"""What can go wrong in the world outside: devices and files. Misuse raises the built-in ValueError.

OSError
└── DeviceError     no device, a port in use, an unplugged cable, a device that falls silent
ValueError
└── DataError       a file that cannot be used, with the place and what to do
"""


class DeviceError(OSError):
    """The DAQ cannot be reached or has stopped."""

    def __init__(self, text: str, cure: str = "") -> None:
        """What is wrong, and what to do about it; str() is both."""
        super().__init__(f"{text}; {cure}" if cure else text)
        self.text = text
        """What is wrong, without a full stop."""
        self.cure = cure
        """What to do about it; empty where that is not known."""


class DataError(ValueError):
    """A file cannot be used for a tap test."""
