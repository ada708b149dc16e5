"""The serial ports of this computer."""

from __future__ import annotations

from dataclasses import dataclass

from serial.tools.list_ports import comports


@dataclass(frozen=True)
class PortInfo:
    """What the system knows of a port; pseudo-terminals are never listed."""

    device: str
    """Path or name to open, e.g. /dev/ttyACM0 or COM3."""
    vendor: int | None = None
    """USB vendor; None where it is no USB device."""
    product: int | None = None
    """USB product."""
    serial_number: str = ""
    """Serial number of the USB device."""
    description: str = ""
    """Description in the system's words."""


def list_ports() -> list[PortInfo]:
    """All ports, by name."""
    return [
        PortInfo(port.device, port.vid, port.pid, port.serial_number or "", port.description or "")
        for port in sorted(comports())
    ]
