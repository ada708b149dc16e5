"""Serial ports: finding them, opening them, and saying why one cannot be opened."""

from acquisition.ports.find_port import find_port, usb_identity
from acquisition.ports.list_ports import PortInfo, list_ports
from acquisition.ports.port_hints import no_ports_hint
from acquisition.ports.serial_link import SerialLink

__all__ = [
    "PortInfo",
    "SerialLink",
    "find_port",
    "list_ports",
    "no_ports_hint",
    "usb_identity",
]
