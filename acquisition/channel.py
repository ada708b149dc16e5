"""What is known of one input of the data acquisition device (DAQ), and a run of its samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Codes, Floats

ChannelQuantity = Literal["force", "acceleration"]
MIN_ADC_BITS = 8
"""No converter for sensors has fewer."""
TapDirection = Literal["x", "y", "xy"]
"""Direction at the tool tip in which is tapped: "xy" hits in x with the sensor in y."""
CROSS_TAP: TapDirection = "xy"
"""Direction of a cross tap: no driving point."""


def parse_direction(text: str) -> TapDirection:
    """A direction from its text; ValueError for what is none.

    >>> parse_direction("x"), parse_direction("xy") == CROSS_TAP
    ('x', True)
    """
    directions: tuple[TapDirection, ...] = get_args(TapDirection)
    for direction in directions:
        if text == direction:
            return direction
    raise ValueError(f"direction={text!r} is none of {', '.join(directions)}; give one of them")


@dataclass(frozen=True)
class Channel:
    """One sensor on one input: all that turns a voltage into a force or an acceleration.

    >>> hammer = Channel("force", sensitivity=2.25e-3, full_scale=5.0)
    >>> round(hammer.scale, 4)  # N a code: 5 V / 2^15 / 2.25 mV/N
    0.0678
    >>> hammer.encode(np.array([100.0, 1e4])).tolist()  # N; what is beyond the rail is clipped there
    [1475, 32767]
    """

    quantity: ChannelQuantity
    """Quantity that the sensor measures."""
    sensitivity: float
    """V per N (force) or V per m/s^2 (acceleration); signed."""
    full_scale: float
    """Voltage of the positive rail (V)."""
    adc_bits: int = 16
    """Resolution; codes run from -2^(bits-1) to 2^(bits-1) - 1."""
    direction: TapDirection | Literal[""] = ""
    """Direction at the tool tip; empty where it is not fixed."""
    serial_number: str = ""
    """Serial number of the sensor."""
    calibration_date: str = ""
    """ISO date of the sensor's calibration; empty where not known."""
    skew: float = 0.0
    """Delay of sampling against channel 0 (s): value k of this channel is taken at t_k + skew."""

    def __post_init__(self) -> None:
        """Refuse what cannot be a channel."""
        if self.quantity not in get_args(ChannelQuantity):
            raise ValueError(f"quantity={self.quantity!r} is none of {', '.join(get_args(ChannelQuantity))}")
        if self.direction and parse_direction(self.direction) == CROSS_TAP:
            raise ValueError(f"direction={self.direction!r} is that of a tap across; a sensor has x or y")
        if not np.isfinite(self.sensitivity) or self.sensitivity == 0:
            raise ValueError(f"{self.quantity} sensitivity={self.sensitivity} is not a finite number other than 0")
        if not (np.isfinite(self.full_scale) and self.full_scale > 0):
            raise ValueError(f"{self.quantity} full_scale={self.full_scale} V is not > 0")
        if not np.isfinite(self.skew):
            raise ValueError(f"{self.quantity} skew={self.skew} s is not a finite number")

    @property
    def name(self) -> str:
        """Quantity, and direction where it is known."""
        return f"{self.quantity} {self.direction}".strip()

    @property
    def scale(self) -> float:
        """Engineering units (N or m/s^2) per ADC code."""
        return float(self.full_scale / 2 ** (self.adc_bits - 1) / self.sensitivity)

    @property
    def rails(self) -> tuple[int, int]:
        """Lowest and highest ADC code."""
        return -(2 ** (self.adc_bits - 1)), 2 ** (self.adc_bits - 1) - 1

    def effective_code_step(self, codes: NDArray[np.integer[Any]]) -> int:
        """Smallest step between codes: a power of 2 above 1 where a converter of fewer bits fills the upper ones only.

        Some devices have fewer bits at higher rates; their highest code is then a step below 2^(bits-1).
        """
        used = int(np.bitwise_or.reduce(codes, axis=None))
        return min(used & -used, 2 ** max(self.adc_bits - MIN_ADC_BITS, 0)) or 1

    def effective_rails(self, codes: NDArray[np.integer[Any]]) -> tuple[int, int]:
        """Lowest and highest code that a converter can give whose codes are these."""
        low, high = self.rails
        return low, high + 1 - self.effective_code_step(codes)

    def encode(self, values: Floats) -> Codes:
        """ADC codes of values (N or m/s^2), rounded and clipped at the rails as the converter does."""
        return np.clip(np.rint(values / self.scale), *self.rails).astype(np.int32)


@dataclass(frozen=True)
class SensorInput:
    """A sensor on a numbered input of a device that does not know what is plugged in there."""

    number: int
    """Number of the input, as printed beside the terminals."""
    channel: Channel
    """The sensor; its full scale is the range to set."""
    iepe: bool = True
    """Whether the device feeds the sensor (IEPE, ICP), where it can."""


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive scans as they came from a source."""

    first_scan: int
    """Index of the first scan since the start of the stream."""
    codes: Codes
    """ADC codes, shape (n_channels, n_scans)."""
    overload: int = 0
    """Bit i set: the device reports channel i overloaded."""
    lost_before: int = 0
    """Scans lost between the block before and this one."""
