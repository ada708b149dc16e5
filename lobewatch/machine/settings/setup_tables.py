"""Tables of machine.toml on the machine, its tap test, its sensors and its DAQ."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from math import hypot, isfinite
from typing import Annotated, Literal, Self

from msgspec import Meta

from acquisition import (
    STANDARD_GRAVITY,
    Channel,
    Conditions,
    DeviceSettings,
    SensorInput,
    TapDirection,
    check_settings,
    find_driver,
)
from acquisition.channel import ChannelQuantity
from acquisition.text_boards import FrameFormat, OutputFormat
from lobewatch.machine.settings.toml_schema import NotNegative, Positive, TomlTable

SensorMounting = Literal["stud", "glue", "wax", "magnet", "hand"]
"""Ways to fix an accelerometer."""
SENSOR_MASS_STD_RATIO = 0.02
"""Standard error of the mass of the accelerometer, relative: as its data sheet says it, or weighed; chosen."""
CABLE_MASS_SHARE, CABLE_MASS_STD_RATIO = 0.5, 0.25
"""Share of the mass of the cable, up to where it is held, that moves along, and its standard error; chosen."""
MAX_SENSOR_MASS_G = 2000.0
"""Mass that no accelerometer has (g)."""


@dataclass(frozen=True)
class SensorLoading:
    """The accelerometer at the tip; ValueError for a mass that none has."""

    mass: float | None = None
    """Mass that moves along with the structure (kg); None where nobody said."""
    mass_std: float = 0.0
    """Standard error of that (kg)."""
    mounting: SensorMounting | Literal[""] | None = None
    """Way it is fixed; "" where nobody said, None where nobody is asked."""

    @classmethod
    def of(
        cls, sensor_g: float | None, cable_g: float = 0.0, mounting: SensorMounting | Literal[""] | None = None
    ) -> Self:
        """From the masses of accelerometer and cable in grams."""
        if sensor_g is None:
            return cls(mounting=mounting)
        if not (isfinite(sensor_g) and 0 <= sensor_g <= MAX_SENSOR_MASS_G):
            raise ValueError(f"a sensor of {sensor_g:g} g: give its mass in g, 0 to {MAX_SENSOR_MASS_G:g}")
        std = hypot(SENSOR_MASS_STD_RATIO * sensor_g, CABLE_MASS_STD_RATIO * cable_g)
        return cls(1e-3 * (sensor_g + CABLE_MASS_SHARE * cable_g), 1e-3 * std, mounting)


class MachineTable(TomlTable, frozen=True):
    """[machine]."""

    name: Annotated[str, Meta(min_length=1)]
    tap_interval_days: Positive = 30.0
    accepted: tuple[str, ...] = ()
    """What was asked about numbers of this file, and is right: lines of `lobewatch check --accept_questions`."""


class TapTable(TomlTable, frozen=True):
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
    sensor_mass_g: Annotated[float, Meta(ge=0, le=MAX_SENSOR_MASS_G)] | None = None
    """Mass of the accelerometer that rides on the tool, with its magnet (g); None where nobody said so."""
    cable_mass_g: NotNegative = 0.0
    """Mass of the cable that it carries (g)."""
    mounting: SensorMounting | None = None
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


class ModeTable(TomlTable, frozen=True):
    """[mode]: which mode is followed."""

    band_hz: tuple[NotNegative, Positive] | None = None
    model_mode: Annotated[int, Meta(ge=1, le=50)] = 1

    def __post_init__(self) -> None:
        """Refuse an empty band."""
        if self.band_hz is not None and not self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"band_hz={list(self.band_hz)} does not rise; give [lowest, highest] in Hz")


class LimitsTable(TomlTable, frozen=True):
    """[limits]: fall of the frequency that calls for attention; the defaults are the paper's."""

    frequency_warn_percent: Positive = 5.0
    """Fall from which it warns (%)."""
    frequency_alarm_percent: Positive = 10.0
    """Fall from which it alarms (%)."""


class SpeedTable(TomlTable, frozen=True):
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


Sensitivity = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""Sensitivity of either sign: an accelerometer may be mounted the other way round."""


class ChannelTable(TomlTable, frozen=True):
    """[[daq.channel]]: a sensor on an input of a device that does not describe its sensors."""

    input: Annotated[int, Meta(ge=0)]
    quantity: Literal["force", "acceleration"]
    range_v: Positive
    sensitivity_mv_per_n: Sensitivity | None = None
    sensitivity_mv_per_g: Sensitivity | None = None
    gain: Positive = 1.0
    iepe: bool = True
    direction: TapDirection | Literal[""] = ""
    serial_number: str = ""
    calibration_date: date | None = None
    skew_us: Annotated[float, Meta(ge=-1e6, le=1e6)] = 0.0

    def __post_init__(self) -> None:
        """Refuse a sensitivity that is missing, stands twice, is zero, or belongs to another quantity."""
        key = "sensitivity_mv_per_n" if self.quantity == "force" else "sensitivity_mv_per_g"
        if (self.sensitivity_mv_per_n is None) == (self.sensitivity_mv_per_g is None):
            raise ValueError("give exactly one of sensitivity_mv_per_n (force) and sensitivity_mv_per_g (acceleration)")
        value = self.sensitivity_mv_per_n if self.quantity == "force" else self.sensitivity_mv_per_g
        if value is None:
            raise ValueError(f"quantity={self.quantity!r} needs {key}, not the other sensitivity")
        if value == 0:
            raise ValueError(f"{key}=0 is not the sensitivity of any sensor; take it from its calibration sheet")

    def build(self) -> SensorInput:
        """The input in SI units: volts at the device per N or per m/s^2."""
        if self.sensitivity_mv_per_n is not None:
            sensitivity = self.sensitivity_mv_per_n / 1e3
        else:
            sensitivity = (self.sensitivity_mv_per_g or 0.0) / 1e3 / STANDARD_GRAVITY
        channel = Channel(
            self.quantity,
            sensitivity * self.gain,
            self.range_v,
            direction=self.direction,
            serial_number=self.serial_number,
            calibration_date=self.calibration_date.isoformat() if self.calibration_date else "",
            skew=self.skew_us / 1e6,
        )
        return SensorInput(self.input, channel, self.iepe)


class PrintingTable(TomlTable, frozen=True):
    """[daq.printing]: what a board with driver = "lines" prints."""

    adc_bits: Annotated[int, Meta(ge=8, le=24)] | None = None
    frame_start: str = ""
    counter: bool = False
    checksum: bool = True
    baud_rate: Annotated[int, Meta(ge=300, le=20_000_000)] = 115200

    def build(self) -> OutputFormat:
        """The same with the start of a frame as bytes; ValueError where that is no hexadecimal number."""
        try:
            start = bytes.fromhex(self.frame_start)
        except ValueError:
            text = f'frame_start="{self.frame_start}" is no row of bytes in hexadecimal; write it as in "AA BB"'
            raise ValueError(text) from None
        frame = FrameFormat(start, self.counter, self.checksum) if start else None
        return OutputFormat(self.adc_bits, frame, self.baud_rate)


class DaqTable(TomlTable, frozen=True):
    """[daq]: the port is remembered here by hand, never written by the program."""

    port: str = ""
    """Port of the device; empty: it is looked for."""
    driver: str = "taps"
    """Name of the driver."""
    sample_rate_hz: Positive | None = None
    """Scans a second (Hz); None leaves it to the driver."""
    loss_detection: bool = True
    """Whether lost scans are to be found."""
    digital_clock: bool = False
    """Whether a square wave on digital input 0 shows the loss of whole scans."""
    accept_measured_rate: bool = False
    """Whether to work with the measured rate of a device whose rate is not the nominal one."""
    calibration_interval_months: Positive = 12.0
    """Time after which a sensor is due to be calibrated again (months)."""
    anti_alias: bool | None = None
    """Whether a filter keeps out what lies above half the sample rate; None: nobody said so."""
    printing: PrintingTable | None = None
    """Format that a board prints in, with driver = "lines"."""
    channel: tuple[ChannelTable, ...] = ()
    """Sensors of a device that does not describe them itself."""

    def __post_init__(self) -> None:
        """Refuse a driver that is not known, and what it does not take."""
        check_settings(find_driver(self.driver), self.settings)

    @property
    def settings(self) -> DeviceSettings:
        """Settings asked of the device, in SI units."""
        inputs = tuple(channel.build() for channel in self.channel)
        printing = self.printing.build() if self.printing else None
        return DeviceSettings(self.sample_rate_hz, inputs, self.loss_detection, self.digital_clock, printing)
