"""machine.toml as the answers so far have made it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from acquisition import find_driver
from lobewatch.machine.set_up.daq_look import DaqLook
from lobewatch.machine.settings.edit_text import TablePlace, Value, edit_text
from lobewatch.machine.settings.machine_file import parse_machine
from lobewatch.machine.settings.toml_text import toml_tables


@dataclass(frozen=True)
class Draft:
    """Text of a machine.toml that is being asked for."""

    text: str
    """Text as it stands."""
    looks: Mapping[str, DaqLook]
    """DAQs that were looked at, by port."""

    def table(self, name: str, number: int | None = None) -> dict[str, Any]:
        """Values of a table; none where it is not there."""
        table: Any = toml_tables(self.text)
        for part in name.split("."):
            table = table.get(part, {})
        if number is None:
            return dict(table)
        return dict(table[number]) if number < len(table) else {}

    def set(self, name: str, number: int | None = None, /, **values: Value) -> Self:
        """With these values in a table; DataError where the text cannot be edited."""
        return replace(self, text=edit_text(self.text, TablePlace(name, number), values))

    @property
    def daq(self) -> DaqLook:
        """DAQ that it names, as far as it was looked at."""
        table = self.table("daq")
        port = table.get("port", "")
        return self.looks.get(port) or DaqLook(port, table.get("driver", "taps"))

    @property
    def needs_sensors(self) -> bool:
        """Whether the DAQ does not know its sensors."""
        return find_driver(self.table("daq").get("driver", "taps")).sensors is None

    @property
    def lacks_sensors(self) -> list[str]:
        """Sensors that are needed and were not told of yet, by the names of their questions."""
        wanted = {} if self.without_force else {"hammer": "force"}
        wanted["accelerometer"] = "acceleration"
        known = [channel.get("quantity") for channel in self.table("daq").get("channel", ())]
        return [name for name, quantity in wanted.items() if self.needs_sensors and quantity not in known]

    @property
    def without_force(self) -> bool:
        """Whether no hammer measures its force."""
        return self.table("tap").get("hammer") == "none"

    def checked(self) -> Self:
        """The same; DataError where it is no machine file."""
        if not self.lacks_sensors:
            parse_machine(self.text)
        return self
