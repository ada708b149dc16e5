"""Which of the devices that lobewatch knows answers on a port."""

from __future__ import annotations

import queue
import threading
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.devices.driver import Driver
from acquisition.devices.registry import not_answering
from acquisition.errors import DeviceError
from acquisition.plugin import words_of
from acquisition.ports.serial_link import SerialLink
from acquisition.remark import Remark
from acquisition.source import DeviceIdentity

PROBE_TIME = 10.0
"""Time within which a driver has asked who answers (s), three times what ours take; chosen."""


@dataclass(frozen=True)
class Answer:
    """Who answers."""

    driver: str
    """Name of the driver, as in [daq] of machine.toml."""
    identity: DeviceIdentity
    """Model, serial number and firmware."""


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
                return Answer(driver.name, identity)
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
    answers = queue.SimpleQueue[object]()

    def ask() -> None:
        try:
            answers.put(driver.probe(link))
        except BaseException as error:  # noqa: BLE001  (of another package: it ends nothing of ours)
            answers.put(error)

    threading.Thread(target=ask, name=f"probe of {driver.name}", daemon=True).start()
    try:
        answer = answers.get(timeout=PROBE_TIME)
    except queue.Empty:
        return not_answering(driver.name, f"has not answered within {PROBE_TIME:g} s who is on {link.port}")
    if answer is None or isinstance(answer, DeviceError):  # unplugged while it was asked
        return None
    if isinstance(answer, BaseException):
        return not_answering(driver.name, f"fails when asked who is on {link.port} ({words_of(answer)})")
    if isinstance(answer, DeviceIdentity) and all(isinstance(word, str) for word in vars(answer).values()):
        return answer
    text = f"answers {type(answer).__name__} when asked who is on {link.port}, not a DeviceIdentity of texts"
    return not_answering(driver.name, text)


def _suggested(drivers: Sequence[Driver], vendor: int | None) -> list[Driver]:
    if vendor is None:
        return list(drivers)
    of_this_vendor = [driver for driver in drivers if vendor in driver.vendors]
    return of_this_vendor or [driver for driver in drivers if not driver.vendors]
