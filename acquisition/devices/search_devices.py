"""The devices of a driver that are on no serial port."""

from __future__ import annotations

from acquisition.devices.ask_driver import ask_driver
from acquisition.devices.driver import Driver
from acquisition.devices.probe_port import is_identity
from acquisition.devices.registry import not_answering
from acquisition.remark import Remark
from acquisition.source import DeviceAddress

ABOUT = "which devices there are"


def search_devices(driver: Driver, remarks: list[Remark]) -> list[DeviceAddress]:
    """What a driver lists; nothing where it has no search, or fails at it, with a remark that is added to `remarks`."""
    if driver.search is None:
        return []
    search = driver.search
    answer = ask_driver(driver.name, lambda: list(search()), ABOUT)
    if isinstance(answer, Remark):
        remarks.append(answer)
    if not isinstance(answer, list):
        return []
    usable = [device for device in answer if _is_usable(driver, device)]
    if len(usable) < len(answer):
        text = f"lists what is no DeviceAddress that begins with {driver.name}: when asked {ABOUT}"
        remarks.append(not_answering(driver.name, text))
    return usable


def _is_usable(driver: Driver, device: object) -> bool:
    """Whether it is an address by which the driver would be found again."""
    return (
        isinstance(device, DeviceAddress)
        and isinstance(device.address, str)
        and device.address.startswith(f"{driver.name}:")
        and is_identity(device.identity)
    )
