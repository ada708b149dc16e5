"""One hammer hit and the input channels that it is recorded with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from acquisition.arrays import Codes, Floats
from acquisition.channel import Channel, ChannelQuantity
from acquisition.errors import DataError

MIN_SAMPLES = 8
"""Smallest number of samples of a hit; chosen."""
MAX_SI_VALUE = 1e50
"""Largest absolute value in SI units. No measurement is larger, and powers of larger values may be infinite."""


def describe_invalid_value(value: complex) -> str:
    return f"larger than {MAX_SI_VALUE:g}" if np.isfinite(value) else "not finite"


@dataclass(frozen=True, eq=False)
class Hit:
    """Force and response of one hammer hit on one time axis; only the response where no force was measured.

    Raises
    ------
    ValueError
        If the records differ in length, are too short, or hold NaN, inf or values beyond 1e50.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)  # N
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> hit = Hit(force, 200 * structure.response(time, 1e-3), 10240.0, pre_trigger=100)
    >>> float(hit.time[100]), check_hit(hit) == HitFlags.OK
    (0.0, True)
    """

    force: Floats
    """Hammer force (N), shape (n,); empty if no sensor measured it."""
    acceleration: Floats
    """Response (m/s^2), shape (n,)."""
    sample_rate: float
    """Sample rate (Hz)."""
    pre_trigger: int = 0
    """Number of samples before the trigger; 0 if unknown."""
    lost_scans: int = 0
    """Number of scans missing inside the record."""
    channels: tuple[Channel, ...] | None = None
    """Force and response channel, or only the response channel, where the hit came from a DAQ."""
    codes: Codes | None = None
    """Raw ADC codes, shape (channels, n), force first; None if the recording has none."""
    overload: int = 0
    """Overloads that the device itself reports: bit 0 the force, bit 1 the response."""
    cross_hit: Hit | None = None
    """Same impact as a second sensor across to the first measured it; None without one."""

    def __post_init__(self) -> None:
        """Convert to arrays and check them."""
        for name in ("force", "acceleration"):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, values)
            if not -MAX_SI_VALUE <= values.min(initial=0.0) <= values.max(initial=0.0) <= MAX_SI_VALUE:
                bad = np.flatnonzero(~(np.abs(values) <= MAX_SI_VALUE))
                flaw = describe_invalid_value(values[bad[0]])
                raise ValueError(f"{name} is {flaw} at {bad.size} of {values.size} samples, first at sample {bad[0]}")
        same = self.force.shape in (self.acceleration.shape, (0,))
        if not same or self.acceleration.ndim != 1 or self.acceleration.size < MIN_SAMPLES:
            shapes = f"force {self.force.shape} and acceleration {self.acceleration.shape}"
            raise ValueError(f"{shapes} must be 1-D records of equal length, at least {MIN_SAMPLES} samples")
        if not 0 < self.sample_rate < math.inf:
            raise ValueError(f"sample_rate={self.sample_rate} Hz is not above 0")

    @classmethod
    def from_codes(
        cls,
        codes: ArrayLike,
        channels: tuple[Channel, ...],
        sample_rate: float,
        pre_trigger: int = 0,
        lost_scans: int = 0,
        overload: int = 0,
        cross_hit: Hit | None = None,
    ) -> Hit:
        """Return a hit from ADC codes, scaled by the sensitivities of its channels.

        Parameters
        ----------
        codes : array_like, shape (channels, n)
            ADC codes, force first.
        channels
            Channel of each row.
        sample_rate
            Sample rate (Hz).
        pre_trigger
            Number of samples before the trigger.
        lost_scans
            Number of scans missing inside the record.
        overload
            Overloads that the device reports, a bit per row.
        cross_hit
            Same impact as a second sensor measured it.
        """
        raw = np.asarray(codes, dtype=np.int32)
        force = raw[0] * channels[0].scale if len(channels) > 1 else np.empty(0)
        response = raw[-1] * channels[-1].scale
        return cls(force, response, sample_rate, pre_trigger, lost_scans, channels, raw, overload, cross_hit)

    @property
    def has_force(self) -> bool:
        """True if the force was measured."""
        return bool(self.force.size)

    @property
    def sensors(self) -> tuple[Channel, ...]:
        """Channels of all sensors of the impact, the response last; empty if it came from no DAQ."""
        channels = self.channels or ()
        return channels if self.cross_hit is None else (*channels[:1], *self.cross_hit.sensors[-1:], *channels[-1:])

    @property
    def signals(self) -> Floats:
        """Measured signals, shape (channels, n): force (N) first, acceleration (m/s^2) last."""
        return np.stack([self.force, self.acceleration] if self.has_force else [self.acceleration])

    @property
    def time(self) -> Floats:
        """Time from the trigger (s), shape (n,)."""
        return (np.arange(self.acceleration.size) - self.pre_trigger) / self.sample_rate


@dataclass(frozen=True)
class TapInputs:
    """Inputs of a device that a tap test reads: force first, response of the driving point last."""

    rows: tuple[int, ...]
    """Index of each input among the channels of the device."""
    channels: tuple[Channel, ...]
    """Sensor on each input."""

    @classmethod
    def select(cls, channels: tuple[Channel, ...], quantity: ChannelQuantity = "force", direction: str = "") -> Self:
        """Select the inputs of a tap test in one direction.

        If there are several responses, the one of the direction is used, for "xy" that of y. A hit in x is also
        recorded by a second sensor along y, if there is one. It comes before the last input.

        Parameters
        ----------
        channels
            Channels of the device.
        quantity
            Quantity that triggers; "acceleration" without a force sensor.
        direction
            Direction of the hit at the tool tip.

        Raises
        ------
        DataError
            If the needed inputs do not exist.
        """
        forces = [i for i, channel in enumerate(channels) if channel.quantity == "force"]
        found = [i for i, channel in enumerate(channels) if channel.quantity == "acceleration"]
        axis, several = direction[-1:] or "x", len(found) > 1
        responses = [i for i in found if not several or (direction and channels[i].direction == axis)]
        if len(responses) != 1 or (quantity == "force" and len(forces) != 1):
            listed = ", ".join(channel.name for channel in channels) or "nothing"
            needed = "one force and one acceleration channel"
            if quantity == "acceleration":
                needed = "exactly one acceleration channel, because no force is measured"
            which = f' with direction = "{axis}"' if several else ""
            raise DataError(f"the DAQ has channels for {listed}. A tap test needs {needed}{which}.")
        cross = [i for i in found if direction == "x" and channels[i].direction == "y" and i not in responses]
        rows = (*forces, *cross[:1], *responses) if quantity == "force" else (*responses,)
        return cls(rows, tuple(channels[row] for row in rows))

    def make_hit(
        self, codes: Codes, sample_rate: float, pre_trigger: int = 0, lost_scans: int = 0, overload: int = 0
    ) -> Hit:
        """Return the hit of some ADC codes.

        Parameters
        ----------
        codes : ndarray, shape (inputs, n)
            ADC codes.
        sample_rate
            Sample rate (Hz).
        pre_trigger
            Number of samples before the trigger.
        lost_scans
            Number of scans missing inside the record.
        overload
            Overloads that the device reports, a bit per row.
        """

        def make_of(response: int, cross_hit: Hit | None = None) -> Hit:
            rows = [0, response] if len(self.rows) > 1 else [response]
            mask = (overload >> response & 1) << 1 | (overload & 1 if len(rows) > 1 else 0)
            sensors = tuple(self.channels[row] for row in rows)
            return Hit.from_codes(codes[rows], sensors, sample_rate, pre_trigger, lost_scans, mask, cross_hit)

        last = len(self.rows) - 1
        return make_of(last, make_of(1) if last > 1 else None)
