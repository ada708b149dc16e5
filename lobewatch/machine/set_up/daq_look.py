"""The DAQs that answer, and what they say of their sensors."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition import STANDARD_GRAVITY, Channel, DataError, DeviceError, find_driver
from acquisition.devices import DeviceSettings, PortSurvey, named_package, survey_ports


@dataclass(frozen=True)
class DaqLook:
    """A port, and who answers there."""

    port: str
    """Port; empty where none is known."""
    driver: str = "taps"
    """Name of the driver."""
    text: str = ""
    """Words for the device; empty where none has answered."""
    channels: tuple[Channel, ...] = ()
    """Channels that the device describes itself."""
    problem: str = ""
    """Reason why nobody answers, a sentence."""

    def sensor_text(self, quantity: str) -> str:
        """Sensitivity of a sensor that the device describes; empty where it does not."""
        for channel in self.channels:
            if channel.quantity == quantity:
                unit, factor = ("mV/N", 1e3) if quantity == "force" else ("mV/g", 1e3 * STANDARD_GRAVITY)
                serial = f", serial number {channel.serial_number}" if channel.serial_number else ""
                return f"{channel.sensitivity * factor:.4g} {unit}{serial}"
        return ""


def find_daqs() -> tuple[DaqLook, ...]:
    """DAQs that answer on the USB ports of this computer."""
    return _answering(survey_ports())


def look_at(port: str) -> DaqLook:
    """Who answers on a port, with a problem in place of the device where nobody does."""
    survey = survey_ports(port)
    answering = _answering(survey)
    if answering:
        return answering[0]
    return DaqLook(port, problem=survey.seen[0].problem or f"no DAQ that lobewatch knows answers on {port}")


def _answering(survey: PortSurvey) -> tuple[DaqLook, ...]:
    looks = []
    for seen in survey.seen:
        if seen.answer is not None:
            identity, driver = seen.answer.identity, seen.answer.driver
            text = f"{identity.model}, serial number {identity.serial}"
            looks.append(DaqLook(seen.port.device, driver, text, _channels(seen.port.device, driver)))
    return tuple(looks)


def _channels(port: str, name: str) -> tuple[Channel, ...]:
    """Channels of a device that describes its sensors."""
    driver = find_driver(name)
    if driver.sensors is None:
        return ()
    try:
        with named_package(name, f"opening {port}"), driver.open(port, DeviceSettings()) as device:
            return device.channels
    except (DataError, DeviceError):
        return ()
