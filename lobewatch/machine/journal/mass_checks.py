"""Measurement chain of a tap test, and journal lines of its checks with a known mass.

A chain is the DAQ with the sensitivities and ranges that turn its voltages into force and acceleration. A check holds
for all tap tests with the same chain, so a change of any of these ends it.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, Self

import msgspec

from acquisition import Channel, Circumstances, DeviceIdentity, TapTest
from acquisition.source import EMULATED_SERIAL, EMULATED_SERIALS
from acquisition.tap_test import SERIAL_PREFIX, parse_device

MASS_CHECK_KIND = "mass-check"
"""Kind of the journal line of a check with a known mass."""
MAX_REPEAT_TIME = timedelta(hours=24)
"""Time within which a check repeats an earlier one, such as after a wrong weighing; chosen."""


class SensorChain(msgspec.Struct, frozen=True):
    """DAQ, sensitivities and ranges between the sensors and the values of a tap test."""

    daq: str
    """Serial number of the DAQ, else its model; "EMULATED" for every emulated one, empty if it reports neither."""
    force_v_per_n: float
    """Sensitivity of the hammer with its gain (V/N)."""
    acceleration_v_per_m_s2: float
    """Sensitivity of the accelerometer with its gain (V per m/s^2)."""
    force_range_v: float
    """Range of the force input (V)."""
    acceleration_range_v: float
    """Range of the acceleration input (V)."""

    @classmethod
    def of(cls, device: DeviceIdentity | Circumstances, channels: Sequence[Channel]) -> Self | None:
        """Make it from the device and its force and acceleration channel; None without a force or for a recording."""
        if isinstance(device, Circumstances):
            device = device.device_identity
        else:  # as a tap test keeps it
            device = parse_device(
                ", ".join([device.model, *([SERIAL_PREFIX + device.serial] if device.serial else [])])
            )
        if device.is_recording or len(channels) < 2:
            return None
        daq = EMULATED_SERIAL if device.serial in EMULATED_SERIALS else device.serial or device.model
        force, response = channels[0], channels[-1]
        return cls(daq, force.sensitivity, response.sensitivity, force.full_scale, response.full_scale)

    @classmethod
    def of_tap(cls, tap: TapTest) -> Self | None:
        """Make that of a live tap test; None for a replayed one."""
        channels = tap.hits[0].channels if tap.hits and tap.source is None else None
        return None if channels is None else cls.of(tap.circumstances, channels)


class MassCheckEntry(msgspec.Struct, frozen=True):
    """Check of hammer and accelerometer with a known mass, a line of the journal."""

    id: str
    """Identity in the journal, "m1" on."""
    date: datetime
    """Time of the check (UTC)."""
    mass_kg: float | None
    """Total moving mass (kg); None for the check of an emulator, which knows its sensitivities."""
    ratio: float
    """Ratio F/(m a) (-)."""
    ratio_std: float
    """Standard error of the ratio (-)."""
    passed: bool
    """True if the sensitivities agree."""
    chain: SensorChain
    """Checked chain."""
    operator: str = ""
    """Name of the operator; empty if unknown."""
    excluded: str = ""
    """Reason of its exclusion, from other lines; empty if included."""

    @property
    def line(self) -> dict[str, Any]:
        """Journal line."""
        fields = {name: value for name, value in msgspec.to_builtins(self).items() if name != "excluded"}
        return {"kind": MASS_CHECK_KIND, **fields, "time": datetime.now(UTC).isoformat()}


def find_deciding_check(chain: SensorChain, time: datetime, checks: Sequence[MassCheckEntry]) -> MassCheckEntry | None:
    """Find the check that decides on a tap test: the first one after it with its chain, else the last one before it.

    So a check that fails after a series ends the trust in all its tests since the last good one (ISO 7626-5). Of checks
    repeated within a day the newest one counts.
    """
    same = [check for check in checks if check.chain == chain and not check.excluded]
    later = [check for check in same if check.date >= time]
    repeated = [check for check in later if check.date - later[0].date < MAX_REPEAT_TIME]
    return next(reversed(repeated or same), None)


def proves_sensitivities(chain: SensorChain | None, time: datetime, checks: Sequence[MassCheckEntry]) -> bool:
    """Return whether checks with a known mass passed within a day before and within a day after a tap test.

    One of them alone shows no amplifier that was switched between it and the test.
    """
    decides = None if chain is None else find_deciding_check(chain, time, checks)
    if decides is None or not decides.passed:
        return False
    passed = [check for check in checks if check.chain == chain and check.passed and not check.excluded]
    gaps = [check.date - time for check in passed if check.mass_kg is not None]
    near = [gap for gap in gaps if abs(gap) <= MAX_REPEAT_TIME]
    return bool(near) and min(near) < timedelta(0) <= max(near)
