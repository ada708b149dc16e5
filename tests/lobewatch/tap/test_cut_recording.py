"""Recording of a cut from a stream: awaited, taken with the air around it, and sensor faults reported."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Block, Channel, DataError, DeviceError, DeviceIdentity, TapsSource, find_driver
from acquisition.emulation import Passage
from acquisition.files.cut_file import read_cut_signal, write_cut_signal
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import compare_cuts
from lobewatch.machine import MachineFolder, make_machine_folder
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.tap.cut_recording import record_cuts
from lobewatch.tap.cut_stream import KEPT_SIGNAL_SECONDS, MAX_OVERLOAD_SPANS, SignalBuffer
from lobewatch.tap.emulated_cut import emulate_cut

RATE = 12800.0
CHANNELS = (Channel("force", 2e-3, 5.0), Channel("acceleration", 1e-2, 5.0))
Floats = NDArray[np.float64]


class Stream:
    """Blocks of a signal as fast as they are read, with the interface of a device that matters here."""

    identity, follows_clock, loss_detection, fault = DeviceIdentity("stream"), False, "", ""

    def __init__(self, signal: Floats, lost_at: int = -1, channels: Any = CHANNELS, overloaded: int = -1) -> None:
        self.signal, self.lost_at, self.channels, self.sample_rate = signal, lost_at, channels, RATE
        self.overloaded = overloaded
        self.events: deque[Any] = deque()

    def blocks(self) -> Iterator[Block]:
        codes = self.channels[-1].encode(self.signal)
        for number, first in enumerate(range(0, codes.size, 256)):
            part = codes[first : first + 256]
            lost = 50 if number == self.lost_at else 0
            rows = np.stack([part if one.quantity == "acceleration" else np.zeros_like(part) for one in self.channels])
            overload = 1 << len(self.channels) - 1 if number == self.overloaded else 0
            yield Block(first, rows, lost_before=lost, overload=overload)


def sound(*parts: tuple[float, bool]) -> Floats:
    """Return seconds of air or cut."""
    random, found = np.random.default_rng(0), []
    for seconds, is_cut in parts:
        time = np.arange(round(seconds * RATE)) / RATE
        lines = sum(5.0 * np.sin(2 * np.pi * 800.0 * k * time) for k in range(1, 7)) if is_cut else 0.0
        found.append(random.normal(scale=0.05, size=time.size) + lines)
    return np.concatenate(found)


def record(stream: Stream, patience: float = 60.0) -> Any:
    told: list[str] = []
    return next(record_cuts(stream, 0.005, patience, told.append)), told  # type: ignore[arg-type]


def test_one_cut_is_taken_with_the_air_around_it() -> None:
    signal = sound((3.0, False), (2.0, True), (4.0, False))
    found, told = record(Stream(signal))
    assert found.duration == pytest.approx(1.0 + 2.0 + 0.3, abs=0.1)
    assert found.codes is not None
    first = round(2.0 * RATE)
    at = int(
        np.argmin(
            [
                np.abs(found.codes[:200] - CHANNELS[1].encode(signal[i : i + 200])).sum()
                for i in range(first - 900, first + 900)
            ]
        )
    )
    assert abs(at - 900) < 0.05 * RATE
    assert len(told) == 1


def test_cut_after_cut_is_recorded_with_its_own_air_until_none_comes() -> None:
    signal = sound((2.0, False), (1.5, True), (2.5, False), (2.0, True), (2.5, False), (1.0, True), (6.0, False))
    found = list(record_cuts(Stream(signal), 0.005, 5.5, lambda _: None))  # type: ignore[arg-type]
    assert [cut.duration for cut in found] == pytest.approx([1.0 + length + 0.3 for length in (1.5, 2.0, 1.0)], abs=0.1)
    assert all(np.std(cut.acceleration[: round(0.8 * RATE)]) < 0.1 for cut in found)


def test_all_accelerometers_are_recorded_and_kept(tmp_path: Path) -> None:
    channels = (*CHANNELS, Channel("acceleration", 2e-2, 5.0, serial_number="B7"))
    found, _ = record(Stream(sound((1.0, False), (1.5, True), (1.0, False)), channels=channels))
    assert found.acceleration.shape == (2, found.codes.shape[1])
    assert found.acceleration[0] == pytest.approx(2 * found.acceleration[1], abs=0.02)
    write_cut_signal(tmp_path / "c1.h5", found, {})
    again, _ = read_cut_signal(tmp_path / "c1.h5")
    assert np.array_equal(again.acceleration, found.acceleration)
    assert again.more_channels == found.more_channels == channels[2:]


def test_an_overload_marks_its_block_only_and_is_forgotten_with_it() -> None:
    long = sound((1.0, False), (1.5, True), (1.0, False))
    found, _ = record(Stream(long, overloaded=round(2.0 * RATE / 256)))
    (span,) = found.overload_spans
    assert np.count_nonzero(found.clipped) == span[1] - span[0] == 256
    assert span[0] / RATE == pytest.approx(2.0 - 0.0, abs=0.05)
    again, _ = record(Stream(np.concatenate([sound((30.0, False)), long]), overloaded=10))
    assert (again.overload, again.overload_spans) == (False, ())
    buffer = SignalBuffer([CHANNELS[1]], [0], RATE)
    for number in range(6000):
        buffer.add(Block(256 * number, np.zeros((1, 256), dtype=np.int32), lost_before=number % 2, overload=number % 2))
    assert max(len(buffer.overloads), len(buffer.lost)) <= KEPT_SIGNAL_SECONDS * RATE / 256


def test_a_part_of_a_stream_has_the_faults_within_it_from_its_own_beginning() -> None:
    buffer = SignalBuffer([CHANNELS[1]], [0], RATE)
    for number in range(500):
        lost, overload = 7 * (number in (50, 200, 450)), number in (100, 300, 470) or number > 480
        buffer.add(Block(256 * number, np.zeros((1, 256), dtype=np.int32), lost_before=lost, overload=overload))
    part = buffer.take(256 * 150 / RATE, 256 * 400 / RATE)
    assert (part.lost_scans, part.overload_spans) == (7, ((256 * 150, 256 * 151),))
    assert np.flatnonzero(part.clipped).tolist() == list(range(256 * 150, 256 * 151))


def test_overloads_without_number_count_everywhere() -> None:
    buffer = SignalBuffer([CHANNELS[1]], [0], RATE)
    for number in range(2 * MAX_OVERLOAD_SPANS + 2):
        buffer.add(Block(256 * number, np.zeros((1, 256), dtype=np.int32), overload=number % 2))
    part = buffer.take(0.0, buffer.seconds)
    assert (part.overload, part.overload_spans) == (True, ())
    assert np.all(part.clipped)


def test_a_cut_that_is_too_short_is_skipped() -> None:
    found, told = record(Stream(sound((1.0, False), (0.3, True), (2.0, False), (1.5, True), (1.0, False))))
    assert found.duration == pytest.approx(1.0 + 1.5 + 0.3, abs=0.1)
    assert len(told) == 2


def test_a_cut_that_does_not_end_is_taken_after_eight_seconds() -> None:
    found, _ = record(Stream(sound((1.0, False), (20.0, True))))
    assert 8.0 < found.duration < 11.0


def test_scans_lost_in_the_part_that_is_kept_are_counted() -> None:
    signal = sound((1.0, False), (1.5, True), (1.0, False))
    assert record(Stream(signal, lost_at=round(2.0 * RATE / 256)))[0].lost_scans == 50


def test_no_cut_in_time_is_reported() -> None:
    with pytest.raises(DataError, match=r"3 s.*record_cuts\.time_limit"):
        record(Stream(sound((5.0, False))), 3.0)


def test_a_dead_sensor_and_a_missing_one_are_reported() -> None:
    with pytest.raises(DeviceError, match="constant"):
        record(Stream(np.zeros(round(3 * RATE))))
    with pytest.raises(DeviceError, match="range"):
        record(Stream(np.full(round(3 * RATE), 1e6)))
    with pytest.raises(DataError, match=r"acceleration channel.*\[\[daq.channel\]\]"):
        record(Stream(sound((1.0, False)), channels=CHANNELS[:1]))


def test_a_cut_that_comes_through_the_port_is_reported_with_its_true_speed(tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    folder = MachineFolder(tmp_path / "m")
    setting = find_cut_setting(folder.machine, "A: slot at 12 600 rpm", 12600.0, 2.0)
    passage = Passage(before=1.2, ramp=0.05, steady=0.7, after=0.6)
    emulated = emulate_cut(folder, find_driver("taps"), setting, realtime=False, passage=passage)
    with emulated.device as device, TapsSource(device.port) as source:
        source.start()
        signal = next(record_cuts(source, 60 / setting.speed_rpm, 30.0, lambda _text: None))
        source.stop()
    (found,) = compare_cuts(Logbook.open(folder.path), setting, signal)
    assert found.detected.verdict == "stable"
    assert found.speed_rpm == pytest.approx(emulated.speed_rpm, rel=5e-5)
    assert found.speed_rpm != pytest.approx(setting.speed_rpm, rel=5e-4)
