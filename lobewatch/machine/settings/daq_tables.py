"""Tables of machine.toml about the data acquisition: the device and, where it does not know them, its sensors."""

from __future__ import annotations

from datetime import date
from typing import Annotated, Literal

from msgspec import Meta

from acquisition import (
    STANDARD_GRAVITY,
    Channel,
    DeviceSettings,
    SensorInput,
    TapDirection,
    check_settings,
    find_driver,
)
from acquisition.lines import FrameFormat, Printing
from lobewatch.machine.settings.toml_table import Positive, Table

Sensitivity = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""Sensitivity of either sign: an accelerometer may be mounted the other way round."""


class ChannelTable(Table, frozen=True):
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


class PrintingTable(Table, frozen=True):
    """[daq.printing]: what a board with driver = "lines" prints."""

    adc_bits: Annotated[int, Meta(ge=8, le=24)] | None = None
    frame_start: str = ""
    counter: bool = False
    checksum: bool = True
    baud_rate: Annotated[int, Meta(ge=300, le=20_000_000)] = 115200

    def build(self) -> Printing:
        """The same with the start of a frame as bytes; ValueError where that is no hexadecimal number."""
        try:
            start = bytes.fromhex(self.frame_start)
        except ValueError:
            text = f'frame_start="{self.frame_start}" is no row of bytes in hexadecimal; write it as in "AA BB"'
            raise ValueError(text) from None
        frame = FrameFormat(start, self.counter, self.checksum) if start else None
        return Printing(self.adc_bits, frame, self.baud_rate)


class Daq(Table, frozen=True):
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
