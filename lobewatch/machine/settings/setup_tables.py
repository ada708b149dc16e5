"""Tables of machine.toml on the machine, its tap test, its sensors and its DAQ."""

from dataclasses import dataclass
from datetime import date
from math import hypot, isfinite
from typing import Annotated, Literal, Self

from msgspec import Meta

import acquisition
from acquisition import Channel, DeviceSettings, SensorInput, TapDirection
from acquisition.channel import ChannelQuantity
from acquisition.text_boards.decoders import FrameFormat, OutputFormat
from lobewatch.machine.settings.display_units import UnitSystem
from lobewatch.machine.settings.toml import NotNegative, Plausible, Positive, TomlTable

SensorMounting = Literal["stud", "glue", "wax", "magnet", "hand"]
"""Mounting of an accelerometer."""
SENSOR_MASS_STD_RATIO = 0.02
"""Relative standard error of the sensor mass from a data sheet or a scale; chosen."""
CABLE_MASS_SHARE, CABLE_MASS_STD_RATIO = 0.5, 0.25
"""Share of the cable mass that moves with the sensor, and its standard error; chosen."""
DEFAULT_TAP_INTERVAL_DAYS = 30.0
"""Interval of tap tests (days) where machine.toml sets none; chosen, a month."""
MAX_SENSOR_MASS_G = 2000.0
"""Largest plausible sensor mass (g)."""


@dataclass(frozen=True)
class SensorLoading:
    """Accelerometer at the tool tip; ValueError for an implausible mass."""

    mass: float | None = None
    """Mass that moves with the structure (kg); None if unknown."""
    mass_std: float = 0.0
    """Standard error of the mass (kg)."""
    mounting: SensorMounting | Literal[""] | None = None
    """Mounting of the accelerometer; "" if unknown, None if irrelevant."""

    @classmethod
    def of(
        cls, sensor_g: float | None, cable_g: float = 0.0, mounting: SensorMounting | Literal[""] | None = None
    ) -> Self:
        """Make it from the masses of accelerometer and cable (g)."""
        if sensor_g is None:
            return cls(mounting=mounting)
        if not (isfinite(sensor_g) and 0 <= sensor_g <= MAX_SENSOR_MASS_G):
            raise ValueError(f"sensor mass {sensor_g:g} g is outside 0 to {MAX_SENSOR_MASS_G:g} g")
        std = hypot(SENSOR_MASS_STD_RATIO * sensor_g, CABLE_MASS_STD_RATIO * cable_g)
        return cls(1e-3 * (sensor_g + CABLE_MASS_SHARE * cable_g), 1e-3 * std, mounting)


class MachineTable(TomlTable, frozen=True):
    """Table [machine]."""

    name: Annotated[str, Meta(min_length=1)]
    """Name of the machine."""
    units: UnitSystem = "metric"
    """Units of lengths without a unit in options, and of texts for people."""
    tap_interval_days: Annotated[Positive, Plausible(0.5, 400)] | None = None
    """Agreed interval of tap tests (days); None: nobody has set one."""
    accepted: tuple[str, ...] = ()
    """Accepted questions about implausible settings."""

    @property
    def interval_days(self) -> float:
        """Interval of tap tests (days), agreed or by default."""
        return DEFAULT_TAP_INTERVAL_DAYS if self.tap_interval_days is None else self.tap_interval_days


class TapTable(TomlTable, frozen=True):
    """Table [tap]: how the tap test is done; trial hits choose a missing record_s and trigger_n."""

    tool: str = "reference"
    """Name of the tapped tool."""
    hammer: Literal["force", "none"] = "force"
    """Force sensor of the hammer; with "none" the acceleration detects hits, and K stays unknown."""
    hits: Annotated[int, Meta(ge=3, le=1000)] = 10
    """Number of good hits."""
    record_s: Annotated[Positive, Plausible(0.01, 9)] | None = None
    """Record length (s); None: chosen by trial hits."""
    pre_trigger_s: Annotated[Positive, Plausible(0.001, 0.9)] = 0.02
    """Pre-trigger time (s)."""
    trigger_n: Annotated[Positive, Plausible(0.2, 199)] | None = None
    """Trigger level of the force (N); None: chosen by trial hits."""
    position_mm: Annotated[NotNegative, Plausible(1, 999)] = 0.0
    """Distance of the hammer from the tool tip (mm)."""
    stick_out_mm: Annotated[float, Plausible(3, 1000)] | None = None
    """Stick-out of the tool (mm)."""
    drawbar_kn: Annotated[float, Plausible(0.5, 150)] | None = None
    """Drawbar force (kN)."""
    state: str = ""
    """State of the machine, a word or two."""
    sensor_mass_g: Annotated[float, Meta(ge=0, le=MAX_SENSOR_MASS_G), Plausible(0.1, 99)] | None = None
    """Mass of the accelerometer with its magnet (g); None if unknown."""
    cable_mass_g: Annotated[NotNegative, Plausible(0.1, 99)] = 0.0
    """Mass of the cable carried by the accelerometer (g)."""
    mounting: SensorMounting | None = None
    """Mounting of the accelerometer."""
    sensor_band_hz: Annotated[Positive, Plausible(100, 99_000)] | None = None
    """Upper frequency limit of the accelerometer from its data sheet (Hz); None: that of the sample rate."""

    def __post_init__(self) -> None:
        self.conditions(self.tool)
        if self.hammer == "none" and self.trigger_n is not None:
            cure = "Remove trigger_n, so that trial hits set the trigger."
            raise ValueError(f'trigger_n={self.trigger_n:g} cannot be used with hammer="none". {cure}')
        if self.cable_mass_g and self.sensor_mass_g is None:
            raise ValueError(f"cable_mass_g={self.cable_mass_g:g} needs sensor_mass_g. Give both masses.")

    @property
    def quantity(self) -> ChannelQuantity:
        """Quantity that detects hits."""
        return "acceleration" if self.hammer == "none" else "force"

    @property
    def sensor(self) -> SensorLoading:
        """Mass and mounting of the accelerometer."""
        return SensorLoading.of(self.sensor_mass_g, self.cable_mass_g, self.mounting or "")

    def conditions(self, tool: str) -> acquisition.Conditions:
        """Return the conditions of a tap test; the stick-out is that of the tapped tool only.

        Parameters
        ----------
        tool
            Name of the tool in the spindle.
        """
        stick_out = self.stick_out_mm if tool == self.tool else None
        return acquisition.Conditions(stick_out_mm=stick_out, drawbar_kn=self.drawbar_kn, state=self.state)


class ModeTable(TomlTable, frozen=True):
    """Table [mode]: choice of the followed mode."""

    band_hz: Annotated[tuple[NotNegative, Positive], Plausible(5, 100_000)] | None = None
    """Frequency band of the followed mode (Hz); None for all frequencies."""
    model_mode: Annotated[int, Meta(ge=1, le=50)] = 1
    """Number of the same mode in the spindle model, from 1."""

    def __post_init__(self) -> None:
        if self.band_hz is not None and not self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"band_hz={list(self.band_hz)} is not in rising order. Give [lowest, highest] in Hz.")


class LimitsTable(TomlTable, frozen=True):
    """Table [limits]: frequency drops that warn and alarm; the defaults are the paper's."""

    frequency_warn_percent: Annotated[Positive, Plausible(0.1, 60)] = 5.0
    """Frequency drop that warns (%)."""
    frequency_alarm_percent: Annotated[Positive, Plausible(0.1, 60)] = 10.0
    """Frequency drop that alarms (%)."""


DROP_LIMITS_PERCENT = (-5.0, 20.0)
"""Smallest and largest frequency drop at speed (%); bearing models give 2 to 8 %, heat may raise a frequency."""
DropPercent = Annotated[float, Plausible(0.05, 20)]
"""Frequency drop at speed (%); negative: a rise."""
FULL_DROP_SPEED_SHARE = 0.25
"""Share of the highest speed from which the whole frequency drop counts; chosen."""


class SpeedTable(TomlTable, frozen=True):
    """Table [speed]: speeds of the spindle, and what its natural frequencies do at speed."""

    low_rpm: Annotated[Positive, Plausible(10, 60_000)] = 1000.0
    """Lowest speed (rpm)."""
    high_rpm: Annotated[Positive, Plausible(300, 250_000)] = 24000.0
    """Highest speed (rpm)."""
    steps: Annotated[int, Meta(ge=50, le=100_000)] = 1151
    """Number of speeds of a diagram."""
    drop_percent: tuple[DropPercent, DropPercent] = (0.0, 5.0)
    """Smallest and largest drop of the natural frequencies at speed (%), below those not rotating; negative: a rise.

    The default is assumed. Jones-type bearing models give 2 to 8 % at high speed, and heat in locked bearings less."""

    def drop_range(self, speed_rpm: float) -> tuple[float, float]:
        """Return the smallest and largest relative frequency drop at a speed (rpm).

        It counts from a quarter of the highest speed on, and below in proportion to the speed.
        """
        share = min(speed_rpm / (FULL_DROP_SPEED_SHARE * self.high_rpm), 1.0) / 100
        return share * self.drop_percent[0], share * self.drop_percent[1]

    def __post_init__(self) -> None:
        lowest, highest = DROP_LIMITS_PERCENT
        if not lowest <= self.drop_percent[0] <= self.drop_percent[1] <= highest:
            raise ValueError(
                f"drop_percent={list(self.drop_percent)} is not in rising order within {lowest:g} to {highest:g} %. "
                "Give [smallest, largest] frequency drop at speed."
            )
        if not self.low_rpm < self.high_rpm:
            cure = "Give the lowest speed, then the highest."
            if self.low_rpm == self.high_rpm:
                around = f"{0.99 * self.low_rpm:g} and {1.01 * self.low_rpm:g}"
                cure = f"For a spindle with one speed, give {around}."
            raise ValueError(f"low_rpm={self.low_rpm:g} is not below high_rpm={self.high_rpm:g}. {cure}")


Sensitivity = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""Sensitivity of either sign: an accelerometer may be mounted reversed."""


class ChannelTable(TomlTable, frozen=True):
    """Table [[daq.channel]]: a sensor on an input of a DAQ that does not describe its sensors."""

    input: Annotated[int, Meta(ge=0)]
    quantity: Literal["force", "acceleration"]
    range_v: Annotated[Positive, Plausible(0.05, 40)]
    sensitivity_mv_per_n: Annotated[Sensitivity, Plausible(0.08, 30)] | None = None
    sensitivity_mv_per_g: Annotated[Sensitivity, Plausible(0.8, 799)] | None = None
    gain: Annotated[Positive, Plausible(0.2, 199)] = 1.0
    iepe: bool = True
    direction: TapDirection | Literal[""] = ""
    model: str = ""
    serial_number: str = ""
    calibration_date: date | None = None
    skew_us: Annotated[float, Meta(ge=-1e6, le=1e6), Plausible(0.05, 49)] = 0.0

    def __post_init__(self) -> None:
        key = "sensitivity_mv_per_n" if self.quantity == "force" else "sensitivity_mv_per_g"
        if (self.sensitivity_mv_per_n is None) == (self.sensitivity_mv_per_g is None):
            raise ValueError("give exactly one of sensitivity_mv_per_n (force) and sensitivity_mv_per_g (acceleration)")
        value = self.sensitivity_mv_per_n if self.quantity == "force" else self.sensitivity_mv_per_g
        if value is None:
            raise ValueError(f"quantity={self.quantity!r} does not fit the unit of the sensitivity. Give {key}.")
        if value == 0:
            raise ValueError(f"{key}=0 is not a sensitivity. Give the value of the calibration sheet.")

    def build(self) -> SensorInput:
        """Build the sensor input in SI units: volts per N or per m/s^2."""
        if self.sensitivity_mv_per_n is not None:
            sensitivity = self.sensitivity_mv_per_n / 1e3
        else:
            sensitivity = (self.sensitivity_mv_per_g or 0.0) / 1e3 / acquisition.STANDARD_GRAVITY
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
    """Table [daq.printing]: output format of a board with driver = "lines"."""

    adc_bits: Annotated[int, Meta(ge=8, le=24)] | None = None
    frame_start: str = ""
    counter: bool = False
    checksum: bool = True
    baud_rate: Annotated[int, Meta(ge=300, le=20_000_000)] = 115200

    def build(self) -> OutputFormat:
        """Build the output format with the frame start as bytes; ValueError for invalid hexadecimal digits."""
        try:
            start = bytes.fromhex(self.frame_start)
        except ValueError:
            text = f'frame_start="{self.frame_start}" is not hexadecimal. Write bytes as in "AA BB".'
            raise ValueError(text) from None
        frame = FrameFormat(start, self.counter, self.checksum) if start else None
        return OutputFormat(self.adc_bits, frame, self.baud_rate)


class DaqTable(TomlTable, frozen=True):
    """Table [daq]; people write the port, the program never does."""

    port: str = ""
    """Port of the DAQ; empty: search all ports."""
    driver: str = "taps"
    """Name of the driver."""
    sample_rate_hz: Annotated[Positive, Plausible(1000, 999_999)] | None = None
    """Sample rate (Hz); None: that of the driver."""
    loss_detection: bool = True
    """True to detect lost scans."""
    digital_clock: bool = False
    """True if a square wave on digital input 0 reveals lost scans."""
    accept_measured_rate: bool = False
    """True to use the measured sample rate if it differs from the nominal one."""
    calibration_interval_months: Annotated[Positive, Plausible(1, 120)] = 12.0
    """Calibration interval of the sensors (months)."""
    anti_alias: bool | None = None
    """True if the DAQ has an anti-aliasing filter; None if unknown."""
    printing: PrintingTable | None = None
    """Output format of a board with driver = "lines"."""
    channel: tuple[ChannelTable, ...] = ()
    """Sensors of a DAQ that does not describe them."""

    def __post_init__(self) -> None:
        acquisition.check_settings(acquisition.find_driver(self.driver), self.settings)

    @property
    def settings(self) -> DeviceSettings:
        """Requested device settings in SI units."""
        inputs = tuple(channel.build() for channel in self.channel)
        printing = self.printing.build() if self.printing else None
        return DeviceSettings(self.sample_rate_hz, inputs, self.loss_detection, self.digital_clock, printing)
