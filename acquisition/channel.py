"""One input of the data acquisition device (DAQ), and a block of its samples."""

from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Codes, Floats

ChannelQuantity = Literal["force", "acceleration"]
MIN_ADC_BITS = 8
"""Smallest resolution of a converter for sensors (bits)."""
TapDirection = Literal["x", "y", "xy"]
"""Direction of a tap test at the tool tip: "xy" hits in x with the sensor in y."""
CROSS_TAP: TapDirection = "xy"
"""Direction of a cross tap, which has no driving point."""


def parse_direction(text: str) -> TapDirection:
    """Return the direction that a text names.

    Parameters
    ----------
    text
        Name of the direction.

    Returns
    -------
    TapDirection
        The same text, typed.

    Raises
    ------
    ValueError
        If the text names no direction.

    Examples
    --------
    >>> parse_direction("x"), parse_direction("xy") == CROSS_TAP
    ('x', True)
    """
    if text not in get_args(TapDirection):
        raise ValueError(f"direction={text!r} is not one of {', '.join(get_args(TapDirection))}")
    return cast(TapDirection, text)


@dataclass(frozen=True)
class Channel:
    """One sensor on one input, with its conversion from voltage to force or acceleration.

    Examples
    --------
    >>> hammer = Channel("force", sensitivity=2.25e-3, full_scale=5.0)
    >>> round(hammer.scale, 4)  # N a code: 5 V / 2^15 / 2.25 mV/N
    0.0678
    >>> hammer.encode(np.array([100.0, 1e4])).tolist()  # N; values beyond the rail are clipped
    [1475, 32767]
    """

    quantity: ChannelQuantity
    """Quantity that the sensor measures."""
    sensitivity: float
    """Sensitivity (V per N or V per m/s^2), signed."""
    full_scale: float
    """Voltage of the positive rail (V)."""
    adc_bits: int = 16
    """Resolution (bits); codes run from -2^(bits-1) to 2^(bits-1) - 1."""
    direction: TapDirection | Literal[""] = ""
    """Direction at the tool tip; empty if it is not fixed."""
    serial_number: str = ""
    """Serial number of the sensor."""
    calibration_date: str = ""
    """Calibration date of the sensor (ISO); empty if unknown."""
    skew: float = 0.0
    """Delay of sampling against channel 0 (s): value k of this channel is taken at t_k + skew."""

    def __post_init__(self) -> None:
        if self.quantity not in get_args(ChannelQuantity):
            raise ValueError(f"quantity={self.quantity!r} is not one of {', '.join(get_args(ChannelQuantity))}")
        if self.direction and parse_direction(self.direction) == CROSS_TAP:
            raise ValueError(f"direction={self.direction!r} is for cross taps only. Give the sensor x or y.")
        if not np.isfinite(self.sensitivity) or self.sensitivity == 0:
            raise ValueError(f"{self.quantity} sensitivity={self.sensitivity} must be a finite number other than 0")
        if not (np.isfinite(self.full_scale) and self.full_scale > 0):
            raise ValueError(f"{self.quantity} full_scale={self.full_scale} V is not above 0")
        if not np.isfinite(self.skew):
            raise ValueError(f"{self.quantity} skew={self.skew} s is not a finite number")

    @property
    def name(self) -> str:
        """Quantity, and direction if known."""
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
        """Return the smallest step between codes: a power of 2 above 1 where the converter fills only the upper bits.

        Some devices have fewer bits at higher rates. Their highest code is then a step below 2^(bits-1).

        Parameters
        ----------
        codes
            ADC codes of this channel, of any shape.
        """
        used = int(np.bitwise_or.reduce(codes, axis=None))
        return min(used & -used, 2 ** max(self.adc_bits - MIN_ADC_BITS, 0)) or 1

    def effective_rails(self, codes: NDArray[np.integer[Any]]) -> tuple[int, int]:
        """Return the lowest and the highest code that the converter of these codes can give.

        Parameters
        ----------
        codes
            ADC codes of this channel, of any shape.
        """
        low, high = self.rails
        return low, high + 1 - self.effective_code_step(codes)

    def encode(self, values: Floats) -> Codes:
        """Return the ADC codes of values, rounded and clipped at the rails as the converter does.

        Parameters
        ----------
        values
            Values (N or m/s^2), of any shape.
        """
        return np.clip(np.rint(values / self.scale), *self.rails).astype(np.int32)


@dataclass(frozen=True)
class SensorInput:
    """Sensor on a numbered input of a device that does not know its sensors."""

    number: int
    """Number of the input, as printed next to the terminals."""
    channel: Channel
    """Sensor; its full scale is the range to set."""
    iepe: bool = True
    """True if the device powers the sensor (IEPE, ICP), if it can."""


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive scans of a source."""

    first_scan: int
    """Index of the first scan since the start of the stream."""
    codes: Codes
    """ADC codes, shape (n_channels, n_scans)."""
    overload: int = 0
    """Bit i is set where the device reports channel i as overloaded."""
    lost_before: int = 0
    """Number of scans lost between the previous block and this one."""
