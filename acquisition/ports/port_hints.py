"""Why a serial port cannot be opened, or is not there at all, and what to do about it on each platform."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from acquisition.errors import DeviceError

NO_PORTS = {
    "linux": "plug the DAQ in and look at the last lines of `sudo dmesg`; hand it through to a container or "
    "virtual machine",
    "darwin": "plug the DAQ in and look for /dev/cu.usbmodem*; allow the accessory where macOS asks",
    "win32": "plug the DAQ in and look under Ports (COM & LPT) of the Device Manager",
}
"""Cure by sys.platform."""


def no_ports_hint(platform: str | None = None) -> str:
    """What to do where no serial port exists, one sentence; platform as `sys.platform` names it, None: this one."""
    cure = NO_PORTS.get(platform or sys.platform, "plug the DAQ in")
    return (
        f"No serial port on this computer: {cure}; try another cable, some carry no data. "
        "A DATAQ device shows none until its LED blinks yellow (CDC mode)."
    )


def explain_open_error(port: str, error: Exception, platform: str = sys.platform) -> DeviceError:
    """The error to raise, with the system's words and what to do."""
    text = str(error)
    busy = "another program uses it: close that program"
    if platform == "linux" and not port.startswith("socket:"):
        busy += f" (`sudo fuser -v {port}` names it; ModemManager lets go after half a minute)"
    missing = "check the cable and the port's name (`lobewatch ports` lists all)"
    hints = {
        "lock": busy,
        "busy": busy,
        "Permission denied": busy if platform == "win32" else _permission_hint(port, platform),
        "Access is denied": busy,
        "No such file": missing,
        "FileNotFound": missing,
        "refused": "nothing listens there: start the device or emulator first",
    }
    cure = next((hint for word, hint in hints.items() if word in text), "check the port's name and the cable")
    number = (error.errno or 0) if isinstance(error, OSError) else 0
    reason = os.strerror(number) if number > 0 else text  # a host that has no address comes with a negative number
    return DeviceError(f"port {port} cannot be opened ({reason})", cure)


def _permission_hint(port: str, platform: str) -> str:
    """The exact fix; on Linux the port's group is what its owner must belong to."""
    if platform != "linux":
        return "you may not use it: ask for the rights of an administrator"
    try:
        group = Path(port).group()
    except (OSError, KeyError):
        group = "dialout"
    return f"you may not use it: sudo usermod -aG {group} $USER, then log out and in again"
