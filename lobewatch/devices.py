"""The DAQ that a machine file names, opened."""

from __future__ import annotations

from acquisition import TapsSource
from lobewatch.machine import Daq


def open_source(daq: Daq, port: str) -> TapsSource:
    """A connected source on a port, as [daq] sets it up; DeviceError where there is none."""
    return TapsSource(port, daq.sample_rate_hz)
