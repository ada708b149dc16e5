"""The TAPS/1 source against the emulator: real bytes through a pseudo-terminal and through TCP."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable, Iterator
from itertools import islice, pairwise

import numpy as np
import pytest

from acquisition import (
    Channel,
    DeviceError,
    Faults,
    HammeredStructure,
    SimulatedSource,
    TapsEmulator,
    TapsSource,
    Trigger,
    capture_hits,
)
from acquisition.taps import Frame, FrameDecoder, MessageType, encode_frame

RATE = 25600.0
TRIGGER = Trigger(level=20.0, n_samples=6400, pre_trigger=512)
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]


@pytest.fixture(params=[False, True], ids=["pty", "tcp"])
def device(request: pytest.FixtureRequest, tapper: Tapper, channels: Pair) -> Iterator[TapsEmulator]:
    with TapsEmulator(tapper(), channels, RATE, realtime=False, tcp=request.param) as emulator:
        yield emulator


def test_scans_arrive_unchanged_and_complete(device: TapsEmulator, tapper: Tapper, channels: Pair) -> None:
    with TapsSource(device.port) as source:
        assert source.channels == channels
        assert source.sample_rate == RATE
        source.start()
        received = list(islice(source.blocks(), 60))
        source.stop()
    expected = list(SimulatedSource(tapper(), channels, RATE, 60 * 512).blocks())
    assert [block.first_scan for block in received] == [512 * i for i in range(60)]
    assert all(np.array_equal(a.codes, b.codes) for a, b in zip(received, expected, strict=True))
    assert not any(block.lost_before for block in received)


def test_start_after_stop_begins_a_new_session_at_scan_zero(device: TapsEmulator) -> None:
    with TapsSource(device.port) as source:
        for _ in range(3):
            source.start()
            first = next(source.blocks())
            source.stop()
            assert first.first_scan == 0


def test_a_device_that_streams_already_is_taken_over(tapper: Tapper, channels: Pair) -> None:
    with TapsEmulator(tapper(), channels, RATE, realtime=True) as device:
        handle = os.open(device.port, os.O_RDWR | os.O_NOCTTY)
        os.write(handle, encode_frame(Frame(MessageType.START, 1, bytes(8))))
        assert len(os.read(handle, 4096)) > 0
        os.close(handle)
        with TapsSource(device.port) as source:
            source.start()
            assert next(source.blocks()).first_scan == 0


@pytest.mark.parametrize("fault", [Faults(drop_every=7), Faults(corrupt_every=7)], ids=["dropped", "corrupted"])
def test_lost_frames_are_counted_exactly_and_mark_the_hits(fault: Faults, tapper: Tapper, channels: Pair) -> None:
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=fault) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        received = list(islice(source.blocks(), 30))
        source.stop()
        assert sum(block.lost_before for block in received) == 4 * 512
        assert received[-1].first_scan + 512 == 30 * 512 + 4 * 512
        source.start()
        hits = list(islice(capture_hits(source, TRIGGER), 3))
    # 6400 scans have 12 or 13 joints between frames inside them, every sixth of which is a gap of 512
    assert {hit.lost_scans for hit in hits} <= {1024, 1536}


def test_unplugging_is_said_in_one_sentence(tapper: Tapper, channels: Pair) -> None:
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=Faults(unplug_after=20_000)) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        with pytest.raises(DeviceError, match="unplugged or switched off; plug it in"):
            list(source.blocks())


def test_a_silent_device_is_given_up(tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.taps_source.SILENCE", 0.3)
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=Faults(stall_after=20_000)) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        with pytest.raises(DeviceError, match="has sent no samples"):
            list(source.blocks())


def test_a_slow_host_loses_scans_and_is_told_how_many(
    tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.taps_emulator.BUFFER_SECONDS", 0.02)
    monkeypatch.setattr("acquisition.serial_link.BUFFER_BYTES", 40_000)
    with TapsEmulator(tapper(), channels, RATE, realtime=True) as device, TapsSource(device.port) as source:
        source.start()
        threading.Event().wait(1.2)
        blocks = list(islice(source.blocks(), 20))
    assert sum(block.lost_before for block in blocks) > 0
    assert all(
        later.first_scan == earlier.first_scan + earlier.codes.shape[1] + later.lost_before
        for earlier, later in pairwise(blocks)
    )


def test_a_port_in_use_is_refused_with_the_cure(device: TapsEmulator) -> None:
    if device.port.startswith("socket"):
        pytest.skip("a TCP port is not exclusive")
    with TapsSource(device.port), pytest.raises(DeviceError, match="another program uses it"):
        TapsSource(device.port)


@pytest.mark.parametrize(
    ("port", "cure"),
    [
        ("/dev/ttyNOT_THERE", "check the cable and the port's name"),
        ("socket://127.0.0.1:1", "start the device or emulator first"),
        ("socket://nowhere", "socket://HOST:PORT is expected"),
    ],
)
def test_a_port_that_does_not_exist_is_refused_with_the_cure(port: str, cure: str) -> None:
    with pytest.raises(DeviceError, match=cure):
        TapsSource(port)


def test_something_that_is_no_daq_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.taps_source.ANSWER_TIME", 0.05)
    master, slave = os.openpty()
    try:
        with pytest.raises(DeviceError, match="no TAPS/1 device answers"):
            TapsSource(os.ttyname(slave))
    finally:
        os.close(master)
        os.close(slave)


def test_a_device_that_describes_itself_wrongly_is_refused(tapper: Tapper) -> None:
    impossible = Channel("force", 1.0, 5.0)
    object.__setattr__(impossible, "quantity", "temperature")
    with (
        TapsEmulator(tapper(), (impossible,), RATE) as device,
        pytest.raises(DeviceError, match=r"describes itself wrongly .*quantity='temperature'"),
    ):
        TapsSource(device.port)


def test_a_24_bit_device_sends_long_words(tapper: Tapper) -> None:
    fine = (Channel("force", 2.25e-3, 5.0, adc_bits=24), Channel("acceleration", 1.02e-3, 5.0, adc_bits=24))
    with TapsEmulator(tapper(), fine, RATE, realtime=False) as device, TapsSource(device.port) as source:
        source.start()
        received = next(source.blocks())
    expected = next(SimulatedSource(tapper(), fine, RATE, 512).blocks())
    assert np.array_equal(received.codes, expected.codes)
    assert np.max(np.abs(received.codes)) > 32767 or np.std(received.codes) > 100


def test_a_rate_that_the_device_does_not_have_is_refused(device: TapsEmulator) -> None:
    with pytest.raises(ValueError, match="sample rate 1000 Hz is none of this device's: 25600 Hz"):
        TapsSource(device.port, sample_rate=1000.0)


def test_commands_are_answered_as_the_protocol_says(tapper: Tapper, channels: Pair) -> None:
    with TapsEmulator(tapper(), channels, RATE, realtime=True) as emulator:
        handle = os.open(emulator.port, os.O_RDWR | os.O_NOCTTY)
        decoder = FrameDecoder()

        def ask(frame: Frame) -> Frame:
            os.write(handle, encode_frame(frame))
            while not (answers := decoder.feed(os.read(handle, 65536))):
                pass
            return answers[0]

        info = json.loads(ask(Frame(MessageType.HELLO, 7)).body)
        assert info["proto"] == 1
        assert [entry["quantity"] for entry in info["channels"]] == ["force", "acceleration"]
        assert ask(Frame(MessageType.STOP, 8)).body == (8).to_bytes(4, "little") + b"\x00\x00"
        refused = ask(Frame(0x55, 9))
        assert refused.type == MessageType.NACK
        assert refused.body[:6] == (9).to_bytes(4, "little") + b"\x01\x00"
        assert b"unknown command 0x55" in refused.body
        os.close(handle)
