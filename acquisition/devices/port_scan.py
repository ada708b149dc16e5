"""Scan serial ports and vendor libraries for devices that answer."""

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
    """Device that answers on a port."""

    driver: str
    """Name of the driver, as in [daq] of machine.toml."""
    identity: DeviceIdentity
    """Model, serial number and firmware."""
    is_hardware_tested: bool = True
    """True if a user has reported that the driver works on hardware."""


def probe_port(
    port: str, drivers: Sequence[Driver], vendor: int | None = None, remarks: list[Remark] | None = None
) -> DeviceAnswer | None:
    """Find the device that answers on a port.

    Unknown devices are spared: each driver that fits the USB vendor asks once. A port without a vendor (a
    pseudo-terminal, socket://) is probed by all drivers.

    Parameters
    ----------
    port
        Port to open.
    drivers
        Drivers that may probe, in order.
    vendor
        USB vendor id of the port, None if it has none.
    remarks
        List to which a remark is added for each driver that fails or hangs.

    Returns
    -------
    DeviceAnswer or None
        Device that answers, None if no known one does.

    Raises
    ------
    DeviceError
        The port cannot be opened.
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
    """Return the device that answers a driver on a port, None for none, or a remark on a driver that fails."""
    doing = f"probing {link.port}"
    answer = query_driver(driver.name, lambda: driver.probe(link), doing)
    if answer is None or isinstance(answer, Remark) or _is_identity(answer):
        return cast("DeviceIdentity | Remark | None", answer)
    text = f"returns {type(answer).__name__} instead of a DeviceIdentity of texts when {doing}"
    return driver_failure_remark(driver.name, text)


def _is_identity(answer: object) -> bool:
    """Return whether an answer is a DeviceIdentity of texts."""
    is_whole = isinstance(answer, DeviceIdentity) and isinstance(answer.knows_sensors, bool)
    return is_whole and all(isinstance(getattr(answer, name), str) for name in ("model", "serial", "firmware"))


def _select_drivers(drivers: Sequence[Driver], vendor: int | None) -> list[Driver]:
    if vendor is None:
        return list(drivers)
    of_this_vendor = [driver for driver in drivers if vendor in driver.usb_vendors]
    return of_this_vendor or [driver for driver in drivers if not driver.usb_vendors]


SEARCH_ACTION = "listing devices"


def search_devices(driver: Driver, remarks: list[Remark]) -> list[DeviceAddress]:
    """List the devices of a driver that are on no serial port.

    Parameters
    ----------
    driver
        Driver to query.
    remarks
        List to which a remark is added if the driver fails.

    Returns
    -------
    list of DeviceAddress
        Devices, empty if the driver has no search or fails.
    """
    if driver.search is None:
        return []
    search = driver.search
    answer = query_driver(driver.name, lambda: list(search()), SEARCH_ACTION)
    if isinstance(answer, Remark):
        remarks.append(answer)
    if not isinstance(answer, list):
        return []
    usable = [device for device in answer if _is_address(device, f"{driver.name}:")]
    if len(usable) < len(answer):
        text = f'returns other entries than a DeviceAddress beginning with "{driver.name}:" when {SEARCH_ACTION}'
        remarks.append(driver_failure_remark(driver.name, text))
    return usable


def _is_address(device: object, prefix: str) -> bool:
    """Return whether this is an address by which the driver with this prefix finds its device again."""
    if not isinstance(device, DeviceAddress) or not isinstance(device.address, str):
        return False
    return device.address.startswith(prefix) and _is_identity(device.identity)


@dataclass(frozen=True)
class ScannedPort:
    """Result of probing one port, or one address of a device on no port."""

    port: PortInfo
    """Port, as the system describes it."""
    answer: DeviceAnswer | None = None
    """Device that answers, None for none."""
    text: str = ""
    """Reason why none answers, in a few words."""
    failure: DeviceError | None = None
    """Error that prevented probing the port, with its remedy."""

    @property
    def problem(self) -> str:
        """Text of that error, empty if there is none."""
        return str(self.failure or "")


@dataclass(frozen=True)
class PortScan:
    """Result of a scan of all ports."""

    ports: tuple[ScannedPort, ...]
    """Scanned ports and their results."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on drivers that cannot be loaded or that fail."""


def scan_ports(only: str = "") -> PortScan:
    """Probe every USB port and search for devices on no port.

    Parameters
    ----------
    only
        Address to probe instead, whatever it is.

    Returns
    -------
    PortScan
        Results, and remarks on drivers that fail.
    """
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
        return ScannedPort(port, text="not probed, because it is not a USB port")
    try:
        answer = probe_port(port.device, drivers, port.vendor, remarks)
    except DeviceError as error:
        return ScannedPort(port, text="cannot be opened", failure=error)
    return ScannedPort(port, answer, "" if answer else "no answer")
