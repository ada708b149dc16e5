"""A device through the bridge: the same scans, losses, overloads and events for a host elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice, pairwise
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Block,
    Channel,
    DataqEmulator,
    DataqFaults,
    DataqSource,
    Device,
    DeviceError,
    Event,
    EventKind,
    HammeredStructure,
    Hammering,
    SensorInput,
    SimulatedSource,
    Structure,
    TapsEmulator,
    TapsFaults,
    TapsSource,
)
from acquisition.taps.bridge import TapsBridge

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]


@contextmanager
def bridged(open_device: Callable[[], Device], **options: Any) -> Iterator[TapsBridge]:
    """Run a bridge. Its `heard` holds the sentences it has reported."""
    bridge = TapsBridge(open_device, print, **options)
    thread = threading.Thread(target=bridge.run)
    thread.start()
    try:
        yield bridge
    finally:
        bridge.stop()
        thread.join(timeout=60)
        assert not thread.is_alive()


def test_scans_and_sensors_arrive_unchanged(tapper: Tapper, channels: Pair) -> None:
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False) as device,
        bridged(lambda: TapsSource(device.port)) as bridge,
    ):
        for _ in range(2):
            with TapsSource(bridge.port) as host:
                assert (host.channels, host.sample_rate, host.follows_clock) == (channels, RATE, False)
                assert host.identity == bridge.device.identity
                host.start()
                blocks = list(islice(host.blocks(), 60))
            if _ == 0:
                expected = list(SimulatedSource(tapper(), channels, RATE, 60 * 512).blocks())
                assert all(np.array_equal(a.codes, b.codes) for a, b in zip(blocks, expected, strict=True))
            assert [block.first_scan for block in blocks] == [512 * i for i in range(60)]
            assert (host.lost_scans, host.dropped_frames) == (0, 0)


@pytest.mark.parametrize("faults", [TapsFaults(drop_every=7), TapsFaults(corrupt_every=7), TapsFaults(cut_every=7)])
def test_what_was_lost_before_the_bridge_is_missing_behind_it(
    tapper: Tapper, channels: Pair, faults: TapsFaults
) -> None:
    expected = np.concatenate(
        [block.codes for block in SimulatedSource(tapper(), channels, RATE, 90 * 512).blocks()], axis=1
    )
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=faults) as device,
        bridged(lambda: TapsSource(device.port)) as bridge,
        TapsSource(bridge.port) as host,
    ):
        host.start()
        blocks = list(islice(host.blocks(), 40))
    assert sum(block.lost_before for block in blocks) >= 5 * 512
    assert all(b.first_scan == a.first_scan + a.codes.shape[1] + b.lost_before for a, b in pairwise(blocks))
    for block in blocks:
        assert np.array_equal(block.codes, expected[:, block.first_scan : block.first_scan + block.codes.shape[1]])


def test_overload_and_events_go_through(tapper: Tapper, channels: Pair) -> None:
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, faults=TapsFaults(overload=2)) as device,
        bridged(lambda: TapsSource(device.port)) as bridge,
        TapsSource(bridge.port) as host,
    ):
        host.start()
        assert {block.overload for block in islice(host.blocks(), 20)} == {2}
        device.send_event(Event(EventKind.BUTTON))
        device.send_event(Event(EventKind.CABLE, channel=1))
        for _ in islice(host.blocks(), 5000):
            if host.fault:
                break
        assert "cable of the acceleration sensor" in host.fault
        assert host.events.popleft().kind == EventKind.BUTTON
        assert host.status is not None
        assert host.status.samples_taken == host.status.samples_sent


def test_a_device_that_is_pulled_is_waited_for(
    tapper: Tapper, channels: Pair, tmp_path: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    link = tmp_path / "daq"
    with (
        TapsEmulator(tapper(), channels, RATE, realtime=False, link=link) as device,
        bridged(lambda: TapsSource(str(link))) as bridge,
    ):
        with TapsSource(bridge.port) as host:
            host.start()
            next(host.blocks())
            device.unplug()
            with pytest.raises(DeviceError, match="unplugged"):
                list(host.blocks())
        with pytest.raises(DeviceError, match=bridge.port):
            TapsSource(bridge.port)
        device.replug()
        deadline = time.monotonic() + 60
        while "again" not in (told := capsys.readouterr().out):
            assert time.monotonic() < deadline, told
            time.sleep(0.05)
        with TapsSource(bridge.port) as host:
            host.start()
            assert next(host.blocks()).first_scan == 0


class Fast(SimulatedSource):
    """Device without a clock. Each scan holds its own number, and some are lost halfway."""

    follows_clock = True
    fault = ""

    def __init__(self, *bits: int) -> None:
        channels = tuple(Channel(name, 1.0, 1.0, n) for name, n in zip(("force", "acceleration"), bits, strict=True))  # type: ignore[arg-type]
        super().__init__(lambda _, n: np.zeros((2, n)), channels, RATE, 40_000_000)
        self.stopped = 0

    def blocks(self) -> Iterator[Block]:
        for block in super().blocks():
            codes = np.tile(np.arange(block.first_scan, block.first_scan + 512, dtype=np.int32) % 2000, (2, 1))
            yield replace(
                block,
                codes=codes,
                first_scan=block.first_scan + 7 * (block.first_scan >= 5120),
                lost_before=7 * (block.first_scan == 5120),
            )

    def stop(self) -> None:
        self.stopped += 1
        super().stop()

    def close(self) -> None: ...


def test_a_host_that_is_late_is_told_what_it_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.taps.bridge.BRIDGE_BUFFER_BYTES", 20_000)
    monkeypatch.setattr("acquisition.taps.source.SILENCE_TIMEOUT", 60.0)  # a busy computer may delay the device
    device = Fast(12, 16)
    with bridged(lambda: device) as bridge, TapsSource(bridge.port) as host:
        assert (host.identity.serial, host.channels[0].adc_bits) == ("no-number", 16)
        host.start()
        keep, is_late = host._link._keep, threading.Event()  # noqa: SLF001
        monkeypatch.setattr(host._link, "_keep", lambda data: (is_late.wait(1.0), keep(data)))  # noqa: SLF001
        blocks = list(islice(host.blocks(), 10))
        is_late.wait(0.5)
        is_late.set()
        for block in host.blocks():
            blocks.append(block)
            if sum(block.lost_before > 7 for block in blocks) > 0 and host.status and host.status.overruns:
                break
    assert all(b.first_scan == a.first_scan + a.codes.shape[1] + b.lost_before for a, b in pairwise(blocks))
    assert next(block.lost_before for block in blocks if block.lost_before) >= 7
    for block in blocks:
        number = block.first_scan - 7 * (block.first_scan > 5120)
        scans = np.arange(number, number + block.codes.shape[1]) % 2000
        assert np.array_equal(block.codes, [16 * scans, scans])


def test_a_device_is_stopped_when_its_host_has_gone() -> None:
    device = Fast(16, 16)
    with bridged(lambda: device) as bridge:
        with TapsSource(bridge.port) as host:
            host.start()
            next(host.blocks())
            stopped = device.stopped
            host._link.close()  # noqa: SLF001  (without a word: its computer has crashed)
        deadline = time.monotonic() + 60
        while device.stopped == stopped and time.monotonic() < deadline:
            time.sleep(0.02)
        assert device.stopped == stopped + 1


def test_a_dataq_with_its_sensors_goes_through(structure: Structure, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a lost packet, for which the device has no message, is detected here and reported there."""
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_STOP_SILENCE", 0.05)
    sensors = (
        SensorInput(0, Channel("force", 2.25e-3, 2.0, serial_number="H-1", calibration_date="2026-01-15")),
        SensorInput(5, Channel("acceleration", 1.02e-3, 5.0, direction="y", skew=1e-6)),
    )
    how = Hammering(double_hits=0.0, overloads=0.0)

    def signal_at(rate: float) -> HammeredStructure:
        return HammeredStructure(structure, rate, np.random.default_rng(1), how)

    faults = DataqFaults(drop_at=60_001)
    with (
        DataqEmulator(signal_at, sensors, realtime=False, faults=faults) as device,
        bridged(lambda: DataqSource(device.port, sensors)) as bridge,
        TapsSource(bridge.port) as host,
    ):
        assert host.channels == tuple(sensor.channel for sensor in sensors)
        assert host.identity.model == "DI-4108"
        host.start()
        blocks = []
        for block in host.blocks():
            blocks.append(block)
            if block.first_scan > 30_000:
                break
    (gap,) = [block for block in blocks if block.lost_before]
    assert gap.first_scan - gap.lost_before == pytest.approx(10_000, abs=2)
    whole = SimulatedSource(signal_at(50_000.0), host.channels, 50_000.0, 79 * 512).blocks()
    expected = np.concatenate([block.codes for block in whole], axis=1)
    for block in blocks:
        assert np.array_equal(block.codes, expected[:, block.first_scan : block.first_scan + block.codes.shape[1]])


def test_no_device_and_no_address_are_rejected(tapper: Tapper, channels: Pair) -> None:
    with pytest.raises(DeviceError, match=r"acquisition.scan_ports"):
        TapsBridge(lambda: TapsSource("/dev/ttyNOT_THERE"), print)
    with TapsEmulator(tapper(), channels, RATE) as device, pytest.raises(OSError, match="assign requested address"):
        TapsBridge(lambda: TapsSource(device.port), print, address="192.0.2.1")
