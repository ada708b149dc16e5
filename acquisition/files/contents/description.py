"""What a person says of a recording."""

from __future__ import annotations

from dataclasses import dataclass, fields
from datetime import datetime
from pathlib import Path

from acquisition.tap import UNSAID, Conditions

_LABELS = ("date", "date_pattern", "tool", "direction", "conditions", "sensor", "without_force")


@dataclass(frozen=True)
class Description:
    """What a person says of a recording; empty or None: nothing. It fills in what the file does not say.

    Where the file says something else that is an error, but for `columns`, which stand in place of its headings.
    """

    columns: tuple[str, ...] = ()
    """Columns, in their order ("time [s]", "force [N]", "-") or by name ("frf [m/N]=H1", "frf=H:2")."""
    quantity: str = ""
    """Quantity of the response: displacement, velocity or acceleration."""
    unit: str = ""
    """Unit of the response (m/s^2, g, um), or of the FRF (m/N, g/N)."""
    force_unit: str = ""
    """Unit of the force (N, lbf)."""
    skip: int | None = None
    """Number of lines above the rows of a text that are passed over."""
    decimal: str = ""
    """Decimal sign of the numbers of a text, "comma" or "point"; the other one stands between thousands."""
    spacing: float | None = None
    """Spacing of the lines of an FRF that the file holds without its frequencies (Hz)."""
    start: float | None = None
    """Frequency of its first line (Hz); 0 where nobody says."""
    force: Path | None = None
    """File that holds the force, where it stands in another: its columns follow those of the response."""
    rate: float | None = None
    """Samples a second (Hz)."""
    averages: int | None = None
    """Hits that an FRF was averaged from."""
    response: int | None = None
    """Number of the response that is meant where there are several, from 1."""
    full_scale: tuple[float, ...] = ()
    """Full scale of each channel in its unit, where values are shares of it."""
    sensitivity: tuple[str, ...] = ()
    """Sensitivity of each channel in volts: "2.25 mV/N", "10.2 mV/g"."""
    without_force: bool = False
    """Whether no force was measured: the response is all that is looked for."""
    sensor: str = "accelerometer"
    """Kind of sensor that a cut was heard by: accelerometer or microphone."""
    tacho: str = ""
    """Name or number of the column of the spindle's speed: that itself where its unit is rpm or Hz, else pulses."""
    pulses: int | None = None
    """Pulses of the tachometer in a turn; None: 1."""
    date: datetime | None = None
    """Time of recording; local time where it has no zone."""
    date_pattern: str = ""
    """Pattern of the date in the file's name, as for strptime ("%Y%m%d"); with "/" in its path."""
    tool: str = ""
    """Name of the tool in the spindle."""
    direction: str = ""
    """Direction at the tool tip, x or y."""
    conditions: Conditions = UNSAID
    """Conditions it was taken under."""

    def of_signals(self) -> list[str]:
        """The options that were given and that say something of the signals in the file."""
        names = [option.name for option in fields(self) if option.name not in _LABELS]
        return [f"--{name.replace('_', '-')}" for name in names if getattr(self, name) not in ("", (), None)]
