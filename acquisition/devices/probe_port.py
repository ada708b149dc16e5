"""Which of the devices that lobewatch knows answers on a port."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.devices.driver import Driver
from acquisition.errors import DeviceError
from acquisition.ports.serial_link import SerialLink
from acquisition.source import DeviceIdentity


@dataclass(frozen=True)
class Answer:
    """Who answers."""

    driver: str
    """Name of the driver, as in [daq] of machine.toml."""
    identity: DeviceIdentity
    """Model, serial number and firmware."""


def probe_port(port: str, drivers: Sequence[Driver], vendor: int | None = None) -> Answer | None:
    """Who answers on a port; None where nobody known does. DeviceError where it cannot be opened.

    Strange devices are spared: each question is put once, and only that which the USB vendor suggests; a port without
    one (vendor None: a pseudo-terminal, socket://) gets all.
    """
    link = SerialLink(port)
    try:
        for driver in _suggested(drivers, vendor):
            identity = driver.probe(link)
            if identity is not None:
                return Answer(driver.name, identity)
    except DeviceError:  # unplugged while it was asked
        return None
    finally:
        link.close()
    return None


def _suggested(drivers: Sequence[Driver], vendor: int | None) -> list[Driver]:
    if vendor is None:
        return list(drivers)
    of_this_vendor = [driver for driver in drivers if vendor in driver.vendors]
    return of_this_vendor or [driver for driver in drivers if not driver.vendors]
