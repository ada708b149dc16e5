"""Serial ports: list, opening, and diagnosis of failures."""

from acquisition.ports.serial_ports import (
    PortInfo,
    SerialLink,
    explain_no_ports,
    find_usb_identity,
    find_usb_port,
    list_serial_ports,
)

__all__ = ["PortInfo", "SerialLink", "explain_no_ports", "find_usb_identity", "find_usb_port", "list_serial_ports"]
