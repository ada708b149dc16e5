"""The DAQ that a machine file names, opened."""

from __future__ import annotations

from acquisition import DataqSource, FileSource, TapsSource
from lobewatch.daq_tables import Daq


def open_source(daq: Daq, port: str) -> TapsSource | DataqSource | FileSource:
    """A connected source on a port, as [daq] sets it up, or the hits of a recording, "file:PATH".

    Raises DeviceError where no device is there, DataError for a file without hits.
    """
    if port.startswith("file:"):
        return FileSource(port.removeprefix("file:"))
    if daq.driver == "dataq":
        inputs = [channel.build() for channel in daq.channel]
        return DataqSource(port, inputs, daq.sample_rate_hz, digital_word=daq.loss_detection)
    return TapsSource(port, daq.sample_rate_hz)
