"""What is not believed of the sensors of a DAQ."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

from acquisition import Channel, calibration_doubt, channel_doubts


def sensor_doubts(channels: Sequence[Channel], today: date, interval_months: float) -> tuple[list[str], list[str]]:
    """Warnings (sensitivities, old calibrations) and errors (dates that cannot be), a sentence each."""
    warnings: list[str] = []
    errors: list[str] = []
    for channel in channels:
        warnings += channel_doubts(channel)
        try:
            warnings.append(calibration_doubt(channel, today, interval_months))
        except ValueError as error:
            errors.append(str(error))
    return list(filter(None, warnings)), errors
