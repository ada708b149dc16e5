"""Scan serial ports and vendor libraries for devices that answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from acquisition.devices.drivers import Driver
from acquisition.devices.registry import driver_failure_remark, load_drivers, query_driver
from acquisition.errors import DeviceError, Remark
from acquisition.ports.serial_ports import PortInfo, SerialLink, list_serial_ports
from acquisition.source import DeviceAddress, DeviceIdentity


@dataclass(frozen=True)
class DeviceAnswer:
    """Who answers."""

    driver: str
    """Name of the driver, as in [daq] of machine.toml."""
    identity: DeviceIdentity
    """Model, serial number and firmware."""
    is_hardware_tested: bool = True
    """Whether somebody has reported that the driver works on hardware."""


def probe_port(
    port: str, drivers: Sequence[Driver], vendor: int | None = None, remarks: list[Remark] | None = None
) -> DeviceAnswer | None:
    """Who answers on a port; None where nobody known does. DeviceError where it cannot be opened.

    Strange devices are spared: each question is put once, and only that which the USB vendor suggests; a port without
    one (vendor None: a pseudo-terminal, socket://) gets all. A driver that fails or does not come back is passed over,
    with a remark that is added to `remarks`.
    """
    link = SerialLink(port)
    try:
        for driver in _select_drivers(drivers, vendor):
            identity = _query_port(driver, link)
            if isinstance(identity, DeviceIdentity):
                return DeviceAnswer(driver.name, identity, driver.is_hardware_tested)
            if isinstance(identity, Remark):
                if remarks is not None:
                    remarks.append(identity)
                link.close()  # it may be read by that driver still
                link = SerialLink(port)
    finally:
        link.close()
    return None


def _query_port(driver: Driver, link: SerialLink) -> DeviceIdentity | Remark | None:
    """What a driver says of a port: who answers, nobody, or why it cannot be believed."""
    about = f"who is on {link.port}"
    answer = query_driver(driver.name, lambda: driver.probe(link), about)
    if answer is None or isinstance(answer, Remark) or is_device_identity(answer):
        return cast("DeviceIdentity | Remark | None", answer)
    text = f"answers {type(answer).__name__} when asked {about}, not a DeviceIdentity of texts"
    return driver_failure_remark(driver.name, text)


def is_device_identity(answer: object) -> bool:
    """Whether an answer is a DeviceIdentity of texts."""
    return isinstance(answer, DeviceIdentity) and all(isinstance(word, str) for word in vars(answer).values())


def _select_drivers(drivers: Sequence[Driver], vendor: int | None) -> list[Driver]:
    if vendor is None:
        return list(drivers)
    of_this_vendor = [driver for driver in drivers if vendor in driver.usb_vendors]
    return of_this_vendor or [driver for driver in drivers if not driver.usb_vendors]


SEARCH_QUESTION = "which devices there are"


def search_devices(driver: Driver, remarks: list[Remark]) -> list[DeviceAddress]:
    """What a driver lists; nothing where it has no search, or fails at it, with a remark that is added to `remarks`."""
    if driver.search is None:
        return []
    search = driver.search
    answer = query_driver(driver.name, lambda: list(search()), SEARCH_QUESTION)
    if isinstance(answer, Remark):
        remarks.append(answer)
    if not isinstance(answer, list):
        return []
    usable = [device for device in answer if _is_valid_address(driver, device)]
    if len(usable) < len(answer):
        text = f"lists what is no DeviceAddress that begins with {driver.name}: when asked {SEARCH_QUESTION}"
        remarks.append(driver_failure_remark(driver.name, text))
    return usable


def _is_valid_address(driver: Driver, device: object) -> bool:
    """Whether it is an address by which the driver would be found again."""
    return (
        isinstance(device, DeviceAddress)
        and isinstance(device.address, str)
        and device.address.startswith(f"{driver.name}:")
        and is_device_identity(device.identity)
    )


@dataclass(frozen=True)
class ScannedPort:
    """A port, or the address of a device on none, and what came of asking there."""

    port: PortInfo
    """Port, as the system knows it."""
    answer: DeviceAnswer | None = None
    """Answer of the device there; None for nobody."""
    text: str = ""
    """Reason why nobody answers, in a few words."""
    problem: str = ""
    """Reason why it could not be asked, a sentence with the cure."""


@dataclass(frozen=True)
class PortScan:
    """All ports that were looked at."""

    ports: tuple[ScannedPort, ...]
    """Ports, and what came of asking at each."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on drivers that cannot be loaded, or fail when they are asked."""


def scan_ports(only: str = "") -> PortScan:
    """Ask on every USB port and look for devices on no port, or ask only at this address, whatever it is."""
    drivers, not_loaded = load_drivers()
    remarks = [*not_loaded]
    searching = [driver for driver in drivers if driver.search and (not only or only.startswith(f"{driver.name}:"))]
    listed = [(driver, device) for driver in searching for device in search_devices(driver, remarks)]
    elsewhere = [_make_scanned_port(driver, device) for driver, device in listed if only in ("", device.address)]
    if only and searching:
        return PortScan(tuple(elsewhere) or (ScannedPort(PortInfo(only), text="no answer"),), tuple(remarks))
    ports = list_serial_ports()
    if only:
        ports = [port for port in ports if port.device == only] or [PortInfo(only)]
    asked = [_scan_port(port, drivers, remarks, named=bool(only)) for port in ports]
    return PortScan((*asked, *elsewhere), tuple(remarks))


def _make_scanned_port(driver: Driver, device: DeviceAddress) -> ScannedPort:
    port = PortInfo(device.address, serial_number=device.identity.serial, description=device.description)
    return ScannedPort(port, DeviceAnswer(driver.name, device.identity, driver.is_hardware_tested))


def _scan_port(port: PortInfo, drivers: Sequence[Driver], remarks: list[Remark], named: bool) -> ScannedPort:
    if port.vendor is None and not named:
        return ScannedPort(port, text="not asked: no USB device")
    try:
        answer = probe_port(port.device, drivers, port.vendor, remarks)
    except DeviceError as error:
        return ScannedPort(port, text="cannot be opened", problem=str(error))
    return ScannedPort(port, answer, "" if answer else "no answer")
