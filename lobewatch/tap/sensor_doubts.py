"""What is not believed of the sensors of a DAQ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import date

from acquisition import Channel, Remark, calibration_doubt, channel_doubts

WRONG = frozenset({"calibration-no-date", "calibration-in-future", "sample-rate-wrong"})
"""Codes of what cannot be, and is to be put right before a sensor or a DAQ is worked with."""


def sensor_doubts(channels: Sequence[Channel], today: date, interval_months: float) -> list[Remark]:
    """Sensitivities and ranges that are not believed, calibrations that are old, not known or of an impossible day."""
    return list(_doubts(channels, today, interval_months))


def _doubts(channels: Sequence[Channel], today: date, interval_months: float) -> Iterator[Remark]:
    for channel in channels:
        yield from channel_doubts(channel)
        calibration = calibration_doubt(channel, today, interval_months)
        if calibration is not None:
            yield calibration
