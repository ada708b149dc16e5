"""TAPS/1 source against the emulator: real bytes through a pseudo-terminal and through TCP."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Block,
    Channel,
    Circumstances,
    DeviceError,
    Event,
    EventKind,
    HammeredStructure,
    HitFlags,
    SimulatedSource,
    TapsEmulator,
    TapsFaults,
    TapsSource,
    Trigger,
    capture_hits,
    check_hit,
    read_tap_hits,
    write_hit,
)
from acquisition.ports.serial_ports import SerialLink
from acquisition.taps.protocol import Frame, FrameDecoder, MessageType, decode_data, encode_frame

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


@pytest.mark.quick
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


@pytest.mark.parametrize(
    ("fault", "lost_each", "damaged"),
    [
        (TapsFaults(drop_every=7), 1, False),
        (TapsFaults(corrupt_every=7), 1, True),
        (TapsFaults(noise_every=7), 1, True),
        (TapsFaults(cut_every=7), 2, True),
        (TapsFaults(duplicate_every=7), 0, True),
    ],
    ids=["dropped", "corrupted", "noise", "cut", "duplicated"],
)
def test_lost_frames_are_counted_exactly_and_mark_the_hits(
    fault: TapsFaults, lost_each: int, damaged: bool, tapper: Tapper, channels: Pair
) -> None:
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=fault) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        expected = np.concatenate(
            [block.codes for block in SimulatedSource(tapper(), channels, RATE, 50 * 512).blocks()], axis=1
        )
        received = list(islice(source.blocks(), 30))
        lost = 512 * sum(lost_each for at in range(7, 30 + 12, 7) if (at + lost_each - 1) * 512 < last(received))
        assert source.lost_scans == sum(block.lost_before for block in received) == lost
        assert (lost > 0) == (lost_each > 0)
        assert (source.dropped_frames > 0) == damaged
        for block in received:
            assert np.array_equal(block.codes, expected[:, block.first_scan : block.first_scan + 512])
        assert all(b.first_scan == a.first_scan + 512 + b.lost_before for a, b in pairwise(received))
        source.stop()
        assert list(source.blocks()) == []
        assert source.lost_scans == lost
        source.start()
        hits = list(islice(capture_hits(source, TRIGGER), 3))
    # 6400 scans have 12 or 13 joints between frames inside them, every sixth (fifth) of which is a gap
    assert all(1024 * lost_each <= hit.lost_scans <= 1536 * lost_each for hit in hits)


def last(blocks: list[Block]) -> int:
    """Return the index of the scan after the last one."""
    return int(blocks[-1].first_scan + blocks[-1].codes.shape[1])


def test_unplugging_is_reported_in_one_sentence(tapper: Tapper, channels: Pair) -> None:
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=TapsFaults(unplug_after=20_000)) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        with pytest.raises(DeviceError, match="unplugged"):
            list(source.blocks())


def test_a_silent_device_is_given_up(tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.taps.source.SILENCE_TIMEOUT", 0.3)
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=TapsFaults(stall_after=20_000)) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        with pytest.raises(DeviceError, match=r"no samples .*0\.3 s"):
            list(source.blocks())


def test_a_slow_host_loses_scans_and_is_told_how_many(
    tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.taps.emulator.TAPS_BUFFER_SECONDS", 0.02)
    monkeypatch.setattr("acquisition.ports.serial_ports.MAX_UNREAD_BYTES", 40_000)
    with TapsEmulator(tapper(), channels, RATE, realtime=True) as device, TapsSource(device.port) as source:
        source.start()
        threading.Event().wait(1.2)
        blocks = list(islice(source.blocks(), 20))
    assert sum(block.lost_before for block in blocks) > 0
    assert all(
        later.first_scan == earlier.first_scan + earlier.codes.shape[1] + later.lost_before
        for earlier, later in pairwise(blocks)
    )


def test_a_port_in_use_is_rejected_with_the_cure(device: TapsEmulator) -> None:
    if device.port.startswith("socket"):
        pytest.skip("a TCP port is not exclusive")
    with TapsSource(device.port), pytest.raises(DeviceError, match="fuser"):
        TapsSource(device.port)


@pytest.mark.parametrize(
    ("port", "cure"),
    [
        ("/dev/ttyNOT_THERE", "acquisition.scan_ports"),
        ("socket://127.0.0.1:1", "refused"),
        ("socket://nowhere", "socket://HOST:PORT"),
    ],
)
def test_a_port_that_does_not_exist_is_rejected_with_the_cure(port: str, cure: str) -> None:
    with pytest.raises(DeviceError, match=cure):
        TapsSource(port)


def test_something_that_is_no_daq_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.taps.source.TAPS_ANSWER_TIMEOUT", 0.05)
    master, slave = os.openpty()
    try:
        with pytest.raises(DeviceError, match=r"TAPS/1 .*STOP, 3 "):
            TapsSource(os.ttyname(slave))
    finally:
        os.close(master)
        os.close(slave)


def test_a_device_that_describes_itself_wrongly_is_rejected(tapper: Tapper) -> None:
    impossible = Channel("force", 1.0, 5.0)
    object.__setattr__(impossible, "quantity", "temperature")
    with (
        TapsEmulator(tapper(), (impossible,), RATE) as device,
        pytest.raises(DeviceError, match="quantity='temperature'"),
    ):
        TapsSource(device.port)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("serial", "", "serial "),
        ("fs_choices", [], r"fs_choices=\[\]"),
        ("fs_choices", [0], r"fs_choices=\[0\]"),
        ("skew_s", float("nan"), "skew=nan s"),
    ],
)
def test_an_info_that_would_spoil_the_time_base_is_rejected(
    device: TapsEmulator, monkeypatch: pytest.MonkeyPatch, key: str, value: Any, message: str
) -> None:
    said = device._info()  # noqa: SLF001
    (said if key in said else said["channels"][1])[key] = value
    monkeypatch.setattr(device, "_info", lambda: said)
    with pytest.raises(DeviceError, match=rf"ValueError: .*{message}"):
        TapsSource(device.port)


def test_a_sensor_without_a_calibration_date_is_taken(device: TapsEmulator, monkeypatch: pytest.MonkeyPatch) -> None:
    said = device._info()  # noqa: SLF001
    said["channels"][0]["sens_date"] = None
    monkeypatch.setattr(device, "_info", lambda: said)
    with TapsSource(device.port) as source:
        assert source.channels[0].calibration_date == ""


@pytest.mark.parametrize(("bits", "form"), [(12, 0), (16, 0), (18, 1), (24, 1), (32, 2)])
def test_a_device_is_asked_for_the_shortest_words_that_hold_its_codes(
    bits: int, form: int, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    formats = set()

    def look(body: bytes) -> Block:
        formats.add(body[11])
        return decode_data(body)

    monkeypatch.setattr("acquisition.taps.protocol.decode_data", look)
    fine = tuple(replace(channel, adc_bits=bits) for channel in channels)
    with TapsEmulator(tapper(), fine, RATE, realtime=False) as device, TapsSource(device.port) as source:
        assert source.channels == fine
        source.start()
        received = list(islice(source.blocks(), 30))
    expected = SimulatedSource(tapper(), fine, RATE, 30 * 512).blocks()
    assert all(np.array_equal(a.codes, b.codes) for a, b in zip(received, expected, strict=True))
    assert formats == {form}
    assert np.max(np.abs([block.codes for block in received])) > 2 ** (bits - 4)


@pytest.mark.parametrize(
    ("n_channels", "bits", "rate", "scans"),
    [(2, 16, 25600.0, 512), (2, 16, 102400.0, 1024), (2, 16, 1e6, 2041), (8, 32, 102400.0, 255)],
)
def test_frames_hold_ten_milliseconds_but_never_more_than_fits(
    n_channels: int, bits: int, rate: float, scans: int, channels: Pair
) -> None:
    """Eight channels of 32 bits fill 32 bytes per scan: (8192 - 28) // 32 of them fit."""
    many = (channels * 4)[:n_channels]
    fine = tuple(replace(channel, adc_bits=bits) for channel in many)
    zeros = np.zeros((n_channels, 1))
    with (
        TapsEmulator(lambda _, n: np.repeat(zeros, n, axis=1), fine, rate, realtime=False) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        assert {block.codes.shape for block in islice(source.blocks(), 3)} == {(n_channels, scans)}


def test_hits_of_a_24_bit_device_keep_their_codes_on_disk(tapper: Tapper, channels: Pair, tmp_path: Path) -> None:
    fine = tuple(replace(channel, adc_bits=24) for channel in channels)
    with TapsEmulator(tapper(), fine, RATE, realtime=False) as device, TapsSource(device.port) as source:
        source.start()
        hit = next(capture_hits(source, TRIGGER))
    write_hit(tmp_path / "hit.h5", hit, Circumstances("mill", datetime(2026, 1, 15, tzinfo=UTC)), HitFlags.OK)
    (kept,) = read_tap_hits(tmp_path / "hit.h5")[0]
    assert hit.codes is not None
    assert np.max(np.abs(hit.codes)) > 32767
    assert np.array_equal(hit.codes, kept.codes)  # type: ignore[arg-type]
    assert check_hit(hit) == check_hit(kept) == HitFlags.OK


@pytest.mark.parametrize(
    ("mask", "flags"),
    [
        (0, HitFlags.OK),
        (1, HitFlags.OVERLOAD_RESPONSE),
        (2, HitFlags.OVERLOAD_FORCE),
        (3, HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE),
        (4, HitFlags.OK),
    ],
)
def test_an_overload_that_the_device_reports_rejects_the_hit(
    mask: int, flags: HitFlags, tapper: Tapper, channels: Pair, tmp_path: Path
) -> None:
    signal = tapper()
    with (
        TapsEmulator(
            lambda first, n: signal(first, n)[::-1],
            channels[::-1],
            RATE,
            realtime=False,
            faults=TapsFaults(overload=mask),
        ) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        hit = next(capture_hits(source, TRIGGER))
    assert check_hit(hit) == flags
    write_hit(tmp_path / "hit.h5", hit, Circumstances("mill", datetime(2026, 1, 15, tzinfo=UTC)), HitFlags.OK)
    assert check_hit(read_tap_hits(tmp_path / "hit.h5")[0][0]) == flags


def test_events_and_standing_faults_reach_the_user(device: TapsEmulator) -> None:
    with TapsSource(device.port) as source:
        assert source.fault == ""
        device.send_event(Event(EventKind.CABLE, channel=1))
        source.start()
        blocks = source.blocks()
        wait_for(blocks, lambda: bool(source.events))
        assert "cable of the acceleration sensor" in source.fault
        device.send_event(Event(EventKind.BUTTON))
        device.send_event(Event(EventKind.CABLE, begins=False, channel=1))
        source.events.clear()
        wait_for(blocks, lambda: len(source.events) == 2)
        button = source.events.popleft()
        assert (button.kind, button.begins, button.channel) == (EventKind.BUTTON, True, None)
        assert button.scan > 0
        assert source.fault == ""


def test_a_fault_names_the_sensor_by_the_number_that_info_gives_it(
    device: TapsEmulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = device._info()  # noqa: SLF001
    said["channels"][0]["i"], said["channels"][1]["i"] = 1, 0
    monkeypatch.setattr(device, "_info", lambda: said)
    monkeypatch.setattr(device, "_configure", lambda _: None)
    with TapsSource(device.port) as source:
        source.start()
        device.send_event(Event(EventKind.CABLE, channel=0))
        for _ in source.blocks():
            if source.fault:
                break
        assert "cable of the acceleration sensor" in source.fault


def test_a_fault_from_before_the_start_is_reported_again(device: TapsEmulator) -> None:
    device.send_event(Event(EventKind.SENSOR_BIAS, channel=0))
    for _ in range(2):
        with TapsSource(device.port) as source:
            source.start()
            wait_for(source.blocks(), lambda: "voltage of the force sensor" in source.fault)


def wait_for(blocks: Iterator[Block], happened: Callable[[], bool]) -> None:
    for _ in islice(blocks, 2000):
        if happened():
            return
    pytest.fail("did not happen within 2000 blocks")


def test_status_is_kept(device: TapsEmulator) -> None:
    with TapsSource(device.port) as source:
        source.start()
        assert source.status is None
        wait_for(source.blocks(), lambda: source.status is not None)
        assert source.status is not None
        assert source.status.samples_sent == source.status.samples_taken
        assert (source.status.overruns, source.status.temperature) == (0, 31.5)


@pytest.mark.parametrize(
    "fault",
    [
        TapsFaults(start_streaming=True),
        TapsFaults(noise_at_start=True),
        TapsFaults(cut_infos=1),
        TapsFaults(start_streaming=True, noise_at_start=True),
    ],
    ids=["streaming", "noise", "INFO cut", "both"],
)
def test_a_bad_beginning_is_overcome(
    fault: TapsFaults, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.taps.source.TAPS_ANSWER_TIMEOUT", 0.3)
    with TapsEmulator(tapper(), channels, RATE, faults=fault) as device, TapsSource(device.port) as source:
        assert source.channels == channels
        source.start()
        first, second = islice(source.blocks(), 2)
        assert [first.first_scan, second.first_scan, source.lost_scans] == [0, 512, 0]


def test_a_device_whose_info_never_arrives_is_rejected(
    tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.taps.source.TAPS_ANSWER_TIMEOUT", 0.05)
    with (
        TapsEmulator(tapper(), channels, RATE, faults=TapsFaults(cut_infos=99)) as device,
        pytest.raises(DeviceError, match=r"TAPS/1 .*HELLO, 3 "),
    ):
        TapsSource(device.port)


def test_a_device_that_restarts_by_itself_is_distinguished_from_a_silent_one(
    tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.taps.source.SILENCE_TIMEOUT", 0.3)
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=TapsFaults(restart_after=20 * 512)) as device,
        TapsSource(device.port) as source,
    ):
        source.start()
        with pytest.raises(DeviceError, match="another stream"):
            list(source.blocks())
        source.start()
        assert next(source.blocks()).first_scan == 0


def test_a_slow_consumer_is_no_silent_device(device: TapsEmulator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.taps.source.SILENCE_TIMEOUT", 2.0)  # a busy computer delays the device too
    with TapsSource(device.port) as source:
        source.start()
        for _ in islice(source.blocks(), 2):
            time.sleep(2.1)


@pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])
def test_a_device_that_is_plugged_in_again_goes_on(tcp: bool, tapper: Tapper, channels: Pair, tmp_path: Path) -> None:
    link = tmp_path / "daq"
    with TapsEmulator(tapper(), channels, RATE, realtime=False, tcp=tcp, link=link) as device:
        port = device.port if tcp else str(link)
        for _ in range(3):
            with TapsSource(port) as source:
                source.start()
                assert next(source.blocks()).first_scan == 0
                device.unplug()
                with pytest.raises(DeviceError, match="unplugged"):
                    list(source.blocks())
                device.replug()
        assert not tcp or device.port == port


@pytest.mark.parametrize("state", ["opened", "idle", "starting", "stopping"])
def test_unplugged_in_any_state_it_is_the_same_sentence(
    state: str, device: TapsEmulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    if state == "opened":

        def opened(port: str) -> SerialLink:
            link = SerialLink(port)
            device.unplug()
            return link

        monkeypatch.setattr("acquisition.taps.source.SerialLink", opened)
        with pytest.raises(DeviceError, match="unplugged"):
            TapsSource(device.port)
        return
    with TapsSource(device.port) as source:
        if state == "stopping":
            source.start()
        device.unplug()
        with pytest.raises(DeviceError, match="unplugged"):
            (source.stop if state == "stopping" else source.start)()


def test_a_rate_that_the_device_does_not_have_is_rejected(device: TapsEmulator) -> None:
    with pytest.raises(ValueError, match=r"1000 Hz .*25600 Hz"):
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
