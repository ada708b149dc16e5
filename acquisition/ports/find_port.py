"""A USB serial port by what is plugged in there: its number may change when it is plugged in again."""

from __future__ import annotations

from serial.tools import list_ports


def find_port(vid: int, serial_number: str) -> str | None:
    """The port of the USB device with this vendor id and serial number; None while it is not plugged in.

    A look at the list of ports, for a caller that waits for a device to come back.
    """
    wanted = (vid, serial_number.casefold())
    ports = (
        port.device for port in list_ports.comports() if (port.vid, (port.serial_number or "").casefold()) == wanted
    )
    return next(ports, None)


def usb_identity(port: str) -> tuple[int, str] | None:
    """Vendor id and serial number of what is plugged in at a port; None where it is no USB device or has no number."""
    for listed in list_ports.comports(include_links=True):
        if listed.device == port and listed.vid is not None and listed.serial_number:
            return listed.vid, listed.serial_number
    return None
