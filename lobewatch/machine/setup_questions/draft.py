"""Draft of machine.toml during setup: detected DAQs, questions and parsed answers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from acquisition import (
    STANDARD_GRAVITY,
    Channel,
    DataError,
    DeviceError,
    DeviceSettings,
    PortScan,
    find_driver,
    scan_ports,
)
from acquisition.devices.registry import convert_driver_errors
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.number_text import format_number
from lobewatch.machine.settings.toml import TablePath, TomlValue, edit_toml, parse_toml_tables
from lobewatch.machine.settings.unit_text import convert_unit_texts


@dataclass(frozen=True)
class DetectedDaq:
    """Port, and the DAQ that answers there."""

    port: str
    """Port; empty if unknown."""
    driver: str = "taps"
    """Name of the driver."""
    text: str = ""
    """Description of the device; empty if none answers."""
    channels: tuple[Channel, ...] = ()
    """Channels that the device describes."""
    problem: str = ""
    """Reason why no device answers, a sentence."""

    def sensor_text(self, quantity: str) -> str:
        """Return the sensitivity of a sensor that the device describes, else an empty text."""
        for channel in self.channels:
            if channel.quantity == quantity:
                unit, factor = ("mV/N", 1e3) if quantity == "force" else ("mV/g", 1e3 * STANDARD_GRAVITY)
                serial = f", serial number {channel.serial_number}" if channel.serial_number else ""
                return f"{channel.sensitivity * factor:.4g} {unit}{serial}"
        return ""


def find_daqs() -> tuple[DetectedDaq, ...]:
    """Find the DAQs on the USB ports of this computer."""
    return _list_answering(scan_ports())


def inspect_port(port: str) -> DetectedDaq:
    """Return the DAQ on a port, with a problem instead of the device if none answers."""
    survey = scan_ports(port)
    answering = _list_answering(survey)
    if answering:
        return answering[0]
    return DetectedDaq(port, problem=survey.ports[0].problem or f"no supported DAQ answers on {port}")


def _list_answering(survey: PortScan) -> tuple[DetectedDaq, ...]:
    looks = []
    for seen in survey.ports:
        if seen.answer is not None:
            identity, driver = seen.answer.identity, seen.answer.driver
            text = f"{identity.model}, serial number {identity.serial}"
            looks.append(DetectedDaq(seen.port.device, driver, text, _read_channels(seen.port.device, driver)))
    return tuple(looks)


def _read_channels(port: str, name: str) -> tuple[Channel, ...]:
    """Read the channels of a device that describes its sensors."""
    driver = find_driver(name)
    if driver.sensor_data is None:
        return ()
    try:
        with convert_driver_errors(name, f"opening {port}"), driver.open(port, DeviceSettings()) as device:
            return device.channels
    except (DataError, DeviceError):
        return ()


@dataclass(frozen=True)
class MachineDraft:
    """Text of machine.toml during setup."""

    text: str
    """Present text."""
    detected_daqs: Mapping[str, DetectedDaq]
    """Inspected DAQs by port."""

    def table(self, name: str, number: int | None = None) -> dict[str, Any]:
        """Return the values of a table; empty without one."""
        table: Any = convert_unit_texts(parse_toml_tables(self.text))
        for part in name.split("."):
            table = table.get(part, {})
        if number is None:
            return dict(table)
        return dict(table[number]) if number < len(table) else {}

    def find_number(self, name: str, key: str, value: str) -> int:
        """Return the index of the table with a value in an array of tables, or of a new one."""
        number = 0
        while (table := self.table(name, number)) and table.get(key) != value:
            number += 1
        return number

    def set(self, name: str, number: int | None = None, /, **values: TomlValue) -> Self:
        """Set values of a table; DataError if the text cannot be edited."""
        return replace(self, text=edit_toml(self.text, TablePath(name, number), values))

    @property
    def daq(self) -> DetectedDaq:
        """DAQ of the draft, as far as inspected."""
        table = self.table("daq")
        port = table.get("port", "")
        return self.detected_daqs.get(port) or DetectedDaq(port, table.get("driver", "taps"))

    @property
    def needs_sensors(self) -> bool:
        """True if the DAQ does not describe its sensors."""
        return find_driver(self.table("daq").get("driver", "taps")).sensor_data is None

    @property
    def missing_sensors(self) -> list[str]:
        """Missing sensors, by the names of their questions."""
        wanted = {} if self.has_no_force_sensor else {"hammer": "force"}
        wanted["accelerometer"] = "acceleration"
        known = [channel.get("quantity") for channel in self.table("daq").get("channel", ())]
        return [name for name, quantity in wanted.items() if self.needs_sensors and quantity not in known]

    @property
    def has_no_force_sensor(self) -> bool:
        """True if no hammer measures force."""
        return self.table("tap").get("hammer") == "none"

    def checked(self) -> Self:
        """Return itself; DataError if the text is no machine file."""
        if not self.missing_sensors:
            parse_machine_file(self.text)
        return self


@dataclass(frozen=True)
class SetupQuestion:
    """Question about a setting that only a person knows."""

    name: str
    """Name of the question."""
    text: str
    """Text of the question, a format with the unit of lengths: {length}."""
    example: str
    """Example of an answer."""
    read_current: Callable[[MachineDraft], str]
    """Function that returns the present answer, "-" if left open, "" without one."""
    apply_answer: Callable[[MachineDraft, str], MachineDraft]
    """Function that applies an answer; ValueError for an invalid one."""
    skip_reason: Callable[[MachineDraft], str] = lambda _: ""
    """Function that returns the reason to skip the question, else an empty text."""


OPEN_ANSWER = "-"
"""Answer that leaves a question open."""


def is_open_answer(answer: str) -> bool:
    """Tell whether an answer leaves a question open."""
    return answer.strip().casefold() in (OPEN_ANSWER, "none", "no", "not known", "unknown")


def format_answer(*values: float | str) -> str:
    """Format numbers as they are typed; texts stay."""
    return " ".join(value if isinstance(value, str) else format_number(value) for value in values)
