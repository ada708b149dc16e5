"""MCC 172: two IEPE inputs on a Raspberry Pi, through daqhats."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from acquisition.channel import SensorInput
from acquisition.errors import DeviceError
from acquisition.makers.library import installed_library, load_library, only_inputs
from acquisition.makers.library_device import LibraryDevice, Piece
from acquisition.source import DeviceAddress, DeviceIdentity

EXTRA = "mcc172"
RATE = 51200.0
"""Highest rate (Hz); the others are it divided by 2 to 256."""
FULL_SCALE = 5.0
"""The only range (V)."""
BLOCK_TIME = 0.02
"""Length of a block (s)."""
SYNC_TIME = 2.0
"""Time within which its converters are in step (s); 128 clock cycles by its documentation."""


def search_mcc172() -> Sequence[DeviceAddress]:
    """Boards on this Raspberry Pi."""
    library = installed_library("daqhats", EXTRA)
    if library is None:
        return []
    boards = library.hat_list(filter_by_id=library.HatIDs.MCC_172)
    return [
        DeviceAddress(f"mcc172:{board.address}", DeviceIdentity("MCC 172"), f"{board.product_name}, 2 inputs")
        for board in boards
    ]


def open_mcc172(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """The board "mcc172:ADDRESS", 0 to 7; of its rates the nearest is taken."""
    library = load_library("daqhats", EXTRA)
    address = port.removeprefix("mcc172:")
    if not address.isdigit():
        raise ValueError(f"port={port!r}: mcc172: is followed by the address of the board, 0 to 7, as in mcc172:0")
    only_inputs([sensor.number for sensor in inputs], 2, "an MCC 172")
    for sensor in inputs:
        if sensor.channel.full_scale != FULL_SCALE:
            raise ValueError(f"range_v={sensor.channel.full_scale:g}: an MCC 172 has {FULL_SCALE:g} V alone")
    try:
        board = library.mcc172(int(address))
        for sensor in inputs:
            board.iepe_config_write(sensor.number, int(sensor.iepe))
        rate = _set_rate(library, board, sample_rate or RATE)
        identity = DeviceIdentity("MCC 172", board.serial(), board.firmware_version().version)
    except library.HatError as error:
        words = " ".join(str(error).split())
        raise DeviceError(f"{port} cannot be opened ({words})", "`lobewatch ports` lists what there is") from error
    channels = tuple(replace(sensor.channel, adc_bits=24) for sensor in inputs)
    reader = Mcc172Reader(library, board, [sensor.number for sensor in inputs], rate)
    return LibraryDevice(port, reader, identity, channels, rate, "buffer overrun")


class Mcc172Reader:
    """Reads a continuous scan of both inputs."""

    def __init__(self, library: Any, board: Any, numbers: Sequence[int], rate: float) -> None:
        """The opened board; numbers: its inputs in order; rate (Hz)."""
        self.errors: tuple[type[Exception], ...] = (library.HatError,)
        self._library, self._board, self._numbers = library, board, list(numbers)
        self._size = round(rate * BLOCK_TIME)

    def start(self) -> None:
        """See Reader."""
        self._board.a_in_scan_start(0b11, 0, self._library.OptionFlags.CONTINUOUS)

    def read(self, timeout: float) -> Piece | None:
        """See Reader; a scan that has overrun its buffer has ended: DeviceError."""
        scan = self._board.a_in_scan_read_numpy(self._size, timeout)
        if scan.hardware_overrun or scan.buffer_overrun:
            raise DeviceError("the MCC 172 has lost scans and stopped", "end other programs on this Raspberry Pi")
        volts = scan.data.reshape(-1, 2).T[self._numbers]
        return Piece(volts) if volts.size else None

    def stop(self) -> None:
        """See Reader."""
        self._board.a_in_scan_stop()
        self._board.a_in_scan_cleanup()

    def close(self) -> None:
        """Switch the supply of the sensors off."""
        for number in self._numbers:
            self._board.iepe_config_write(number, 0)

    def fault(self) -> str:
        """Nothing: the board does not tell."""
        return ""


def _set_rate(library: Any, board: Any, rate: float) -> float:
    """Set the clock to the rate nearest to this (Hz) and wait until the converters are in step; that rate (Hz)."""
    board.a_in_clock_config_write(library.SourceType.LOCAL, rate)
    deadline = time.monotonic() + SYNC_TIME
    while not (clock := board.a_in_clock_config_read()).synchronized:
        if time.monotonic() > deadline:
            raise DeviceError("the converters of the MCC 172 do not come into step", "restart the Raspberry Pi")
        time.sleep(0.005)
    return float(clock.sample_rate_per_channel)
