"""Which of the devices that lobewatch knows answers on a port."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from acquisition.devices.ask_driver import ask_driver
from acquisition.devices.driver import Driver
from acquisition.devices.registry import not_answering
from acquisition.ports.serial_link import SerialLink
from acquisition.remark import Remark
from acquisition.source import DeviceIdentity


@dataclass(frozen=True)
class Answer:
    """Who answers."""

    driver: str
    """Name of the driver, as in [daq] of machine.toml."""
    identity: DeviceIdentity
    """Model, serial number and firmware."""
    is_tried: bool = True
    """Whether somebody has reported that the driver works on hardware."""


def probe_port(
    port: str, drivers: Sequence[Driver], vendor: int | None = None, remarks: list[Remark] | None = None
) -> Answer | None:
    """Who answers on a port; None where nobody known does. DeviceError where it cannot be opened.

    Strange devices are spared: each question is put once, and only that which the USB vendor suggests; a port without
    one (vendor None: a pseudo-terminal, socket://) gets all. A driver that fails or does not come back is passed over,
    with a remark that is added to `remarks`.
    """
    link = SerialLink(port)
    try:
        for driver in _suggested(drivers, vendor):
            identity = _ask(driver, link)
            if isinstance(identity, DeviceIdentity):
                return Answer(driver.name, identity, driver.is_tried)
            if isinstance(identity, Remark):
                if remarks is not None:
                    remarks.append(identity)
                link.close()  # it may be read by that driver still
                link = SerialLink(port)
    finally:
        link.close()
    return None


def _ask(driver: Driver, link: SerialLink) -> DeviceIdentity | Remark | None:
    """What a driver says of a port: who answers, nobody, or why it cannot be believed."""
    about = f"who is on {link.port}"
    answer = ask_driver(driver.name, lambda: driver.probe(link), about)
    if answer is None or isinstance(answer, Remark) or is_identity(answer):
        return cast("DeviceIdentity | Remark | None", answer)
    text = f"answers {type(answer).__name__} when asked {about}, not a DeviceIdentity of texts"
    return not_answering(driver.name, text)


def is_identity(answer: object) -> bool:
    """Whether an answer is a DeviceIdentity of texts."""
    return isinstance(answer, DeviceIdentity) and all(isinstance(word, str) for word in vars(answer).values())


def _suggested(drivers: Sequence[Driver], vendor: int | None) -> list[Driver]:
    if vendor is None:
        return list(drivers)
    of_this_vendor = [driver for driver in drivers if vendor in driver.vendors]
    return of_this_vendor or [driver for driver in drivers if not driver.vendors]
