"""Boards that print their samples: decoded lines and frames, and lost scans."""

from __future__ import annotations

import os
import struct
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import (
    Block,
    Channel,
    DeviceError,
    DeviceSettings,
    SensorInput,
    check_settings,
    find_driver,
    probe_port,
)
from acquisition.devices.drivers import BUILT_IN_DRIVERS
from acquisition.emulation import SignalFunction
from acquisition.text_boards.decoders import (
    FrameFormat,
    LineDecoder,
    OutputFormat,
    PrintedRows,
    ScanCounter,
    SimpleFrameDecoder,
)
from acquisition.text_boards.source import TextBoardEmulator, TextBoardSource, TextBoardTraits

FORCE, ACCELERATION = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
INPUTS = SensorInput(0, FORCE), SensorInput(1, ACCELERATION)
RATE = 5000.0
FRAME = FrameFormat(b"\xaa\xbb", counter=True)
RAMP_SCANS = 4000
"""Scans after which the ramp begins again."""


def ramp(first: int, count: int) -> NDArray[np.float64]:
    """Return N and m/s^2 that identify each scan."""
    scans = np.arange(first, first + count) % RAMP_SCANS
    return np.array([scans * 0.5 - 500.0, 300.0 - scans * 0.25])


def falling(first: int, count: int) -> NDArray[np.float64]:
    """Return only the m/s^2 of `ramp`."""
    return ramp(first, count)[1:]


def first_scan(scans: NDArray[np.float64]) -> int:
    """Return the number of the first scan from rough numbers of successive scans, where the ramp may begin again."""
    off = scans - np.arange(scans.size) - scans[0]
    return round(float(scans[0] + np.mean((off + RAMP_SCANS / 2) % RAMP_SCANS - RAMP_SCANS / 2)))


@contextmanager
def printed(
    printing: OutputFormat | None = None, traits: TextBoardTraits | None = None, alone: bool = False
) -> Iterator[TextBoardSource]:
    """Return a source that listens to an emulated board without a clock. alone: acceleration only, no force."""
    inputs = (SensorInput(0, ACCELERATION),) if alone else INPUTS
    sensitivities = tuple(sensor.channel.sensitivity for sensor in inputs)
    signal = falling if alone else ramp
    board = TextBoardEmulator(signal, sensitivities, 5.0, RATE, realtime=False, printing=printing, traits=traits)
    with board, TextBoardSource(board.port, inputs, RATE, printing) as source:
        source.start()
        yield source
        source.stop()


def take(source: TextBoardSource, scans: int) -> list[Block]:
    blocks: list[Block] = []
    for block in source.blocks():
        blocks.append(block)
        if block.first_scan + block.codes.shape[1] > scans:
            break
    return blocks


@pytest.mark.parametrize(
    ("printing", "traits", "step"),
    [
        (None, None, 1e-7),
        (None, TextBoardTraits(counter_bits=0), 1e-7),
        (OutputFormat(adc_bits=12), TextBoardTraits(counter_bits=8), 5 / 2**11),
        (OutputFormat(frame=FRAME), None, 5 / 2**15),
        (OutputFormat(frame=FrameFormat(b"\x02", checksum=False)), None, 5 / 2**15),
    ],
    ids=["volts", "no counter", "12 bits", "frames", "frames without checksum"],
)
def test_what_is_printed_is_what_is_felt(
    printing: OutputFormat | None, traits: TextBoardTraits | None, step: float
) -> None:
    with printed(printing, traits) as source:
        blocks = take(source, 6000)
        channels = source.channels
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    values = codes * np.array([[channel.scale] for channel in channels])
    first = first_scan(values[0, :200] * 2 + 1000)
    expected = ramp(first, values.shape[1])
    tolerance = np.array([[0.51 * step / FORCE.sensitivity], [0.51 * step / ACCELERATION.sensitivity]])
    assert (np.abs(values - expected) <= tolerance + 1e-3).all()
    assert sum(block.lost_before for block in blocks) == 0


@pytest.mark.parametrize(
    ("printing", "traits"),
    [
        (None, None),
        (None, TextBoardTraits(counter_bits=0)),
        (OutputFormat(frame=FRAME), None),
        (OutputFormat(frame=FrameFormat(b"\x02\x03")), None),
    ],
    ids=["counter", "no counter", "frames", "frames without counter"],
)
def test_an_acceleration_alone_is_read(printing: OutputFormat | None, traits: TextBoardTraits | None) -> None:
    with printed(printing, traits, alone=True) as source:
        blocks = take(source, 3000)
        (channel,) = source.channels
    values = np.concatenate([block.codes for block in blocks], axis=1)[0] * channel.scale
    first = first_scan((300.0 - values[:200]) * 4)
    assert np.abs(values - falling(first, values.size)).max() <= 0.51 * 5 / 2**15 / ACCELERATION.sensitivity + 1e-3
    assert sum(block.lost_before for block in blocks) == 0


@pytest.mark.parametrize("alone", [False, True], ids=["force too", "acceleration alone"])
@pytest.mark.parametrize("printing", [None, OutputFormat(frame=FRAME)], ids=["lines", "frames"])
@pytest.mark.parametrize(
    "traits", [TextBoardTraits(drop_every=700), TextBoardTraits(garble_every=700)], ids=["lost", "broken"]
)
def test_a_counter_tells_what_is_lost(printing: OutputFormat | None, traits: TextBoardTraits, alone: bool) -> None:
    with printed(printing, traits, alone) as source:
        blocks = take(source, 7000)
    gaps = [block.lost_before for block in blocks if block.lost_before]
    assert gaps == [1] * len(gaps)
    assert 8 <= len(gaps) <= 11


@pytest.mark.quick
def test_without_a_counter_a_broken_line_is_seen_and_a_lost_one_is_not() -> None:
    with printed(None, TextBoardTraits(counter_bits=0, garble_every=700)) as source:
        assert 8 <= sum(block.lost_before for block in take(source, 7000)) <= 11
    with printed(None, TextBoardTraits(counter_bits=0, drop_every=700)) as source:
        assert sum(block.lost_before for block in take(source, 7000)) == 0


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 65535), st.integers(-(2**15), 2**15 - 1), st.integers(-(2**15), 2**15 - 1)), min_size=2
    ),
    st.data(),
)
def test_rows_do_not_depend_on_how_the_bytes_are_cut(scans: list[tuple[int, int, int]], data: st.DataObject) -> None:
    text = b"boot\n" + b"".join(b"%d; %d\t%d\r\n" % scan for scan in scans)
    frames = b"".join(_frame(*scan) for scan in scans)
    for stream, decoder in ((text, LineDecoder()), (frames, SimpleFrameDecoder(FRAME))):
        cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=5)))
        pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
        rows = [row for piece in pieces for printed in decoder.feed(piece) for row in printed.rows.tolist()]
        assert [tuple(map(int, row)) for row in rows] == scans


@pytest.mark.parametrize("idle", [0, 2, 514])
@pytest.mark.parametrize("begin", [0, 1, 2, 3, 4, 7])
def test_a_value_that_looks_like_a_start_puts_no_frame_out_of_step(idle: int, begin: int) -> None:
    levels = np.where(np.arange(400) < 200, idle, 300 * np.sin(np.arange(400))).astype(np.int16)
    stream = b"".join(b"\x02" + struct.pack("<hh", level, 7) for level in levels.tolist())
    lost = stream[:1502] + stream[1503:]  # one byte of frame 300
    decoder = SimpleFrameDecoder(FrameFormat(b"\x02", checksum=False))
    printed = [rows for i in range(begin, len(lost), 33) for rows in decoder.feed(lost[i : i + 33])]
    rows = np.concatenate([part.rows for part in printed])
    assert set(rows[:, 1]) == {7.0}
    skipped = -(-begin // 5)
    assert rows[:, 0].tolist() == [*levels[skipped:300].tolist(), *levels[301:-1].tolist()]
    assert [part.broken_before for part in printed if part.broken_before] == [1]


def test_frames_that_cannot_be_told_from_their_values_are_not_read() -> None:
    decoder = SimpleFrameDecoder(FrameFormat(b"\x02", checksum=False))
    assert list(decoder.feed(500 * (b"\x02" + struct.pack("<hh", 700, 7)))) == []


def _frame(counter: int, *values: int) -> bytes:
    payload = counter.to_bytes(2, "little") + b"".join(value.to_bytes(2, "little", signed=True) for value in values)
    return b"\xaa\xbb" + payload + bytes([sum(payload) % 256])


@settings(deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_are_read_without_an_error(noise: bytes) -> None:
    for decoder in (LineDecoder(), SimpleFrameDecoder(FRAME)):
        for printed in decoder.feed(b"\n" + noise):
            assert np.isfinite(printed.rows).all()


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_a_counter_that_restarts_is_no_loss(bits: int) -> None:
    counter = ScanCounter()
    start = 2**bits - 300
    counts = (start + np.arange(600)) % 2**bits
    counts = np.delete(counts, [50, 450, 451])
    rows = np.column_stack([counts, counts, counts]).astype(np.float64)
    lost = [lost for part in (rows[:100], rows[100:]) for _, lost in counter.split_runs(PrintedRows(part))]
    assert [gap for gap in lost if gap] == [1, 2]


@pytest.mark.parametrize(
    ("signal", "bits", "numbers"),
    [(ramp, 16, "3 numbers"), (ramp, 0, "2 numbers"), (falling, 16, "2 numbers"), (falling, 0, "1 number")],
)
def test_ports_names_a_board_that_prints_by_listening_alone(signal: SignalFunction, bits: int, numbers: str) -> None:
    sensitivities = (FORCE.sensitivity, ACCELERATION.sensitivity)[-len(signal(0, 1)) :]
    with TextBoardEmulator(signal, sensitivities, 5.0, RATE, traits=TextBoardTraits(counter_bits=bits)) as board:
        answer = probe_port(board.port, BUILT_IN_DRIVERS)
    assert answer is not None
    assert answer.driver == "lines"
    assert f" {numbers} " in answer.identity.model


@contextmanager
def silent_port() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        yield master, os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)


def test_a_board_that_prints_something_else_is_a_device_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.text_boards.source.SILENCE_TIMEOUT", 0.3)
    with silent_port() as (master, port), TextBoardSource(port, INPUTS, RATE) as source:
        source.start()
        os.write(master, b"hello\nthe answer is 42\n" * 10)
        with pytest.raises(DeviceError, match=r"no samples .*0\.3 s.*baud_rate"):
            list(islice(source.blocks(), 1))


def test_frames_that_look_like_their_values_are_a_device_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.text_boards.source.SILENCE_TIMEOUT", 0.3)
    printing = OutputFormat(frame=FrameFormat(b"\x02", checksum=False))
    with silent_port() as (master, port), TextBoardSource(port, INPUTS, RATE, printing) as source:
        source.start()
        os.write(master, b"\x02\xbc\x02\x07\x00" * 100)
        with pytest.raises(DeviceError, match="frame_start"):
            list(islice(source.blocks(), 1))


def test_an_unplugged_board_is_a_device_error() -> None:
    sensitivities = FORCE.sensitivity, ACCELERATION.sensitivity
    board = TextBoardEmulator(ramp, sensitivities, 5.0, RATE, realtime=False)
    with board, TextBoardSource(board.port, INPUTS, RATE) as source:
        source.start()
        stream = source.blocks()
        next(stream)
        board.unplug()
        with pytest.raises(DeviceError, match="unplugged"):
            list(stream)


@pytest.mark.parametrize(
    ("driver", "settings", "reason"),
    [
        ("lines", DeviceSettings(None, INPUTS), "sample_rate_hz"),
        ("lines", DeviceSettings(RATE, (INPUTS[0], SensorInput(2, ACCELERATION))), "input = 0, 2 .*0 to 1"),
        ("lines", DeviceSettings(RATE, (SensorInput(1, ACCELERATION),)), "input = 1 .*0 to 0"),
        ("dataq", DeviceSettings(RATE, INPUTS, printing=OutputFormat()), r"\[daq\.printing\]"),
    ],
)
@pytest.mark.quick
def test_settings_that_no_such_board_has(driver: str, settings: DeviceSettings, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        check_settings(find_driver(driver), settings)
