"""Serial ports: list, opening, and diagnosis of failures."""

from acquisition.ports.serial_ports import SerialLink

__all__ = ["SerialLink"]
