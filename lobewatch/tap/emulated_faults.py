"""Emulate what people do wrong in a tap test: turning spindle, broken cables, swapped channels, a fallen sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from acquisition import Channel, Hammering, SensorInput
from acquisition.emulation import SignalFunction
from lobewatch.arrays import Floats


class EmulatedFault(StrEnum):
    """Fault of the measurement chain."""

    NONE = "none"
    """No fault."""
    RESPONSE_CABLE = "response-cable"
    """The cable of the accelerometer is broken: only mains hum."""
    FORCE_CABLE = "force-cable"
    """The cable of the hammer is broken: only mains hum."""
    OPEN_INPUT = "open-input"
    """The input of the accelerometer is open: its voltage drifts."""
    SATURATED = "saturated"
    """The amplifier of the accelerometer is at its limit."""
    SWAPPED = "swapped"
    """The cables of hammer and accelerometer are swapped."""
    FALLING_SENSOR = "falling-sensor"
    """The accelerometer comes loose: its signal decreases by half every 2 s."""
    SOFT_TIP = "soft-tip"
    """The hammer has a soft tip: pulses are five times as long."""
    MAINS_HUM = "mains-hum"
    """Weak hum of the mains in the accelerometer, which does no harm."""


BROKEN_CABLE_HUM = {"force": 2.0, "acceleration": 30.0}
"""Hum of a broken cable (N and m/s^2 rms), chosen."""
WEAK_HUM = 3.0
"""Harmless hum in the accelerometer (m/s^2 rms), chosen: above its noise."""
HUM_HARMONICS = {1: 1.0, 3: 0.3, 5: 0.1}
"""Harmonics of the mains and their relative amplitudes, chosen."""
DRIFT_STEP = 0.3
"""Step of the drift of an open input from scan to scan (m/s^2), chosen."""
SENSOR_HALF_LIFE = 2.0
"""Time in which the signal of a loosening accelerometer halves (s), chosen."""
SOFT_TIP_WIDTH = (2.75e-3, 3.75e-3)
"""Range of the foot width of a pulse with a soft tip (s), chosen."""
UNBALANCE_ACCELERATION = 8.0
"""Acceleration at once per revolution of a spindle that turns at UNBALANCE_RPM (m/s^2 rms), chosen: 0.5 at 3000 rpm."""
UNBALANCE_RPM = 12_000.0
"""Speed of this acceleration (rpm), which grows with the square of the speed."""
UNBALANCE_HARMONICS = {1: 1.0, 2: 0.2}
"""Harmonics of the spindle speed and their relative amplitudes, chosen."""


@dataclass(frozen=True)
class EmulatedFaults:
    """Faults of an emulated tap test."""

    kind: EmulatedFault = EmulatedFault.NONE
    """Fault of the measurement chain."""
    turning_rpm: float = 0.0
    """Speed of a spindle that turns though it should not (rpm), 0 for one at rest."""
    begin: float = 0.0
    """Time at which they begin (s)."""
    clock_error: float = 0.0
    """Relative error of the sample clock, of which the device does not know."""

    @property
    def hammering(self) -> Hammering:
        """Impacts of the operator."""
        return Hammering(width_range=SOFT_TIP_WIDTH) if self.kind is EmulatedFault.SOFT_TIP else Hammering()

    def apply(self, signal: SignalFunction, inputs: Sequence[SensorInput], rate: float) -> SignalFunction:
        """Return the signal function with these faults. inputs: sensor of each row. rate: sample rate (Hz)."""
        channels, random = [sensor.channel for sensor in inputs], np.random.default_rng(1)

        drift = np.zeros(1)

        def disturbed(first_scan: int, n_scans: int) -> Floats:
            nonlocal drift
            rows = signal(first_scan, n_scans)
            drift = drift[-1] + DRIFT_STEP * np.cumsum(random.normal(size=n_scans))
            time = (first_scan + np.arange(n_scans)) / rate - self.begin
            begun = time >= 0
            return np.where(begun, self._disturb(rows, time, channels, drift), rows) if begun.any() else rows

        return disturbed

    def _disturb(self, rows: Floats, time: Floats, channels: Sequence[Channel], drift: Floats) -> Floats:
        quantities = [channel.quantity for channel in channels]
        growth = (self.turning_rpm / UNBALANCE_RPM) ** 2
        unbalance = UNBALANCE_ACCELERATION * growth * _make_tone(time, self.turning_rpm / 60, UNBALANCE_HARMONICS)
        if self.kind is EmulatedFault.SWAPPED:
            return _swap(rows, channels)
        return np.stack(
            [
                self._disturb_row(row, time, channel, drift) + unbalance * (quantity == "acceleration")
                for row, channel, quantity in zip(rows, channels, quantities, strict=True)
            ]
        )

    def _disturb_row(self, row: Floats, time: Floats, channel: Channel, drift: Floats) -> Floats:
        """Return the signal of a channel with the fault of the chain."""
        hum, fault = _make_tone(time, 50.0, HUM_HARMONICS), self.kind
        broken = {"force": EmulatedFault.FORCE_CABLE, "acceleration": EmulatedFault.RESPONSE_CABLE}
        if fault is broken[channel.quantity]:
            return BROKEN_CABLE_HUM[channel.quantity] * hum
        if channel.quantity == "force":
            return row
        disturbed = {
            EmulatedFault.OPEN_INPUT: drift,
            EmulatedFault.SATURATED: np.full(row.size, 2 * channel.full_scale / abs(channel.sensitivity)),
            EmulatedFault.FALLING_SENSOR: row * 0.5 ** (time / SENSOR_HALF_LIFE),
            EmulatedFault.MAINS_HUM: row + WEAK_HUM * hum,
        }
        return disturbed.get(fault, row)


NO_FAULTS = EmulatedFaults()
"""Tap test without a fault."""


def _make_tone(time: Floats, frequency: float, harmonics: dict[int, float]) -> Floats:
    """Return a tone with harmonics, whose first has an rms of 1."""
    waves = (share * np.sin(2 * np.pi * k * frequency * time) for k, share in harmonics.items())
    return np.asarray(np.sqrt(2) * sum(waves))


def _swap(rows: Floats, channels: Sequence[Channel]) -> Floats:
    """Return the signals with the voltages of the first two channels swapped."""
    first, second = channels[:2]
    ratio = second.sensitivity / first.sensitivity
    return np.concatenate([[rows[1] * ratio, rows[0] / ratio], rows[2:]])
