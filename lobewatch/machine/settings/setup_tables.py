"""Tables of machine.toml about the machine itself: name, how it is tapped, what is followed, from when it alarms."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from acquisition import Conditions
from acquisition.channel import ChannelQuantity
from lobewatch.machine.settings.sensor_loading import MOST_GRAMS, Mounting, SensorLoading
from lobewatch.machine.settings.toml_table import NotNegative, Positive, Table


class Identity(Table, frozen=True):
    """[machine]."""

    name: Annotated[str, Meta(min_length=1)]
    tap_interval_days: Positive = 30.0
    accepted: tuple[str, ...] = ()
    """What was asked about numbers of this file, and is right: lines of `lobewatch check --accept`."""


class TapSetup(Table, frozen=True):
    """[tap]: how the tap test is done; record_s and trigger_n that are not given are chosen by trial hits."""

    tool: str = "reference"
    """Name of the tool that is tapped."""
    hammer: Literal["force", "none"] = "force"
    """Whether a hammer measures its force; with "none" hits are seen by the acceleration alone, and K stays unknown."""
    hits: Annotated[int, Meta(ge=3, le=1000)] = 10
    """Number of good hits."""
    record_s: Positive | None = None
    """Length of a record (s); None: chosen by trial hits."""
    pre_trigger_s: Positive = 0.02
    """Part of a record before the hit (s)."""
    trigger_n: Positive | None = None
    """Force that starts a record (N); None: chosen by trial hits."""
    position_mm: NotNegative = 0.0
    """Place of the hammer, from the tool tip (mm)."""
    stick_out_mm: float | None = None
    """Stick-out of the tool (mm)."""
    drawbar_kn: float | None = None
    """Force of the drawbar (kN)."""
    state: str = ""
    """State of the machine, in a word or two of the shop's."""
    sensor_mass_g: Annotated[float, Meta(ge=0, le=MOST_GRAMS)] | None = None
    """Mass of the accelerometer that rides on the tool, with its magnet (g); None where nobody said so."""
    cable_mass_g: NotNegative = 0.0
    """Mass of the cable that it carries (g)."""
    mounting: Mounting | None = None
    """Mounting of the accelerometer."""
    sensor_band_hz: Positive | None = None
    """Highest frequency that the accelerometer passes, from its data sheet; None: that of the sample rate."""

    def __post_init__(self) -> None:
        """Refuse what no spindle has."""
        self.conditions(self.tool)
        if self.hammer == "none" and self.trigger_n is not None:
            raise ValueError(
                f'trigger_n={self.trigger_n:g} with hammer="none": no force triggers; leave it out, trial hits choose'
            )
        if self.cable_mass_g and self.sensor_mass_g is None:
            raise ValueError(f"cable_mass_g={self.cable_mass_g:g} without sensor_mass_g; give both")

    @property
    def quantity(self) -> ChannelQuantity:
        """Quantity by which hits are seen."""
        return "acceleration" if self.hammer == "none" else "force"

    @property
    def sensor(self) -> SensorLoading:
        """The accelerometer."""
        return SensorLoading.of(self.sensor_mass_g, self.cable_mass_g, self.mounting or "")

    def conditions(self, tool: str) -> Conditions:
        """Conditions of a tap test with a tool; the stick-out of `tool` alone."""
        stick_out = self.stick_out_mm if tool == self.tool else None
        return Conditions(stick_out_mm=stick_out, drawbar_kn=self.drawbar_kn, state=self.state)


class ModeChoice(Table, frozen=True):
    """[mode]: which mode is followed."""

    band_hz: tuple[NotNegative, Positive] | None = None
    model_mode: Annotated[int, Meta(ge=1, le=50)] = 1

    def __post_init__(self) -> None:
        """Refuse an empty band."""
        if self.band_hz is not None and not self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"band_hz={list(self.band_hz)} does not rise; give [lowest, highest] in Hz")


class Limits(Table, frozen=True):
    """[limits]: fall of the frequency that calls for attention; the defaults are the paper's."""

    frequency_warn_percent: Positive = 5.0
    """Fall from which it warns (%)."""
    frequency_alarm_percent: Positive = 10.0
    """Fall from which it alarms (%)."""


class SpeedRange(Table, frozen=True):
    """[speed]: the range of the lobe diagrams."""

    low_rpm: Positive = 1000.0
    """Slowest speed (rpm)."""
    high_rpm: Positive = 24000.0
    """Fastest speed (rpm)."""
    steps: Annotated[int, Meta(ge=50, le=100_000)] = 1151
    """Number of speeds of a diagram."""

    def __post_init__(self) -> None:
        """Refuse an empty range."""
        if not self.low_rpm < self.high_rpm:
            around = (
                f"of a spindle of one speed give what is around it, {0.99 * self.low_rpm:g} and {1.01 * self.low_rpm:g}"
            )
            cure = around if self.low_rpm == self.high_rpm else "give the lowest, then the highest"
            raise ValueError(f"low_rpm={self.low_rpm:g} is not below high_rpm={self.high_rpm:g}; {cure}")
