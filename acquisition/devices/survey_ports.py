"""The serial ports of this computer and which device answers on each, and the devices that are on no serial port."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.devices.driver import Driver
from acquisition.devices.probe_port import Answer, probe_port
from acquisition.devices.registry import load_drivers
from acquisition.devices.search_devices import search_devices
from acquisition.errors import DeviceError
from acquisition.ports.list_ports import PortInfo, list_ports
from acquisition.remark import Remark
from acquisition.source import DeviceAddress


@dataclass(frozen=True)
class SeenPort:
    """A port, or the address of a device on none, and what came of asking there."""

    port: PortInfo
    """Port, as the system knows it."""
    answer: Answer | None = None
    """Answer of the device there; None for nobody."""
    text: str = ""
    """Reason why nobody answers, in a few words."""
    problem: str = ""
    """Reason why it could not be asked, a sentence with the cure."""


@dataclass(frozen=True)
class PortSurvey:
    """All ports that were looked at."""

    seen: tuple[SeenPort, ...]
    """Ports, and what came of asking at each."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on drivers that cannot be loaded, or fail when they are asked."""


def survey_ports(only: str = "") -> PortSurvey:
    """Ask on every USB port and look for devices on no port, or ask only at this address, whatever it is."""
    drivers, not_loaded = load_drivers()
    remarks = [*not_loaded]
    searching = [driver for driver in drivers if driver.search and (not only or only.startswith(f"{driver.name}:"))]
    listed = [(driver, device) for driver in searching for device in search_devices(driver, remarks)]
    elsewhere = [_found(driver, device) for driver, device in listed if only in ("", device.address)]
    if only and searching:
        return PortSurvey(tuple(elsewhere) or (SeenPort(PortInfo(only), text="no answer"),), tuple(remarks))
    ports = list_ports()
    if only:
        ports = [port for port in ports if port.device == only] or [PortInfo(only)]
    asked = [_ask(port, drivers, remarks, named=bool(only)) for port in ports]
    return PortSurvey((*asked, *elsewhere), tuple(remarks))


def _found(driver: Driver, device: DeviceAddress) -> SeenPort:
    port = PortInfo(device.address, serial_number=device.identity.serial, description=device.description)
    return SeenPort(port, Answer(driver.name, device.identity, driver.is_tried))


def _ask(port: PortInfo, drivers: Sequence[Driver], remarks: list[Remark], named: bool) -> SeenPort:
    if port.vendor is None and not named:
        return SeenPort(port, text="not asked: no USB device")
    try:
        answer = probe_port(port.device, drivers, port.vendor, remarks)
    except DeviceError as error:
        return SeenPort(port, text="cannot be opened", problem=str(error))
    return SeenPort(port, answer, "" if answer else "no answer")
