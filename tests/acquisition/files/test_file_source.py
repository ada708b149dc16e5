"""Recorded hits replayed as a live source: the same hits come out again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from acquisition import (
    Channel,
    Circumstances,
    DataError,
    DeviceIdentity,
    FileSource,
    HammeredStructure,
    HitFlags,
    SimulatedSource,
    TapTest,
    Trigger,
    average_good_hits,
    capture_hits,
    check_hit,
    estimate_frf,
    new_tap_id,
    read_hits,
    write_tap,
)

TRIGGER = Trigger(20.0, 6400, 512)
ABOUT = Circumstances("mill", datetime(2026, 1, 15, 9, 30, tzinfo=UTC))
Pair = tuple[Channel, Channel]


def tap_file(path: Path, tapper: Callable[..., HammeredStructure], channels: Pair) -> TapTest:
    source = SimulatedSource(tapper(double_hits=0.3, overloads=0.2), channels, 25600.0, 120_000)
    first, second, *others = capture_hits(source, TRIGGER)
    hits = (replace(first, lost_scans=7), replace(second, overload=2), *others)
    frf, flags = average_good_hits(hits)
    tap = TapTest(new_tap_id(ABOUT), ABOUT, frf, hits, flags)
    write_tap(path, tap)
    return tap


@pytest.mark.parametrize("bits", [16, 24])
def test_hits_of_a_tap_file_come_out_bit_by_bit(
    bits: int, tmp_path: Path, tapper: Callable[..., HammeredStructure], channels: Pair
) -> None:
    force, response = (replace(channel, adc_bits=bits) for channel in channels)
    tap = tap_file(tmp_path / "a.h5", tapper, (force, response))
    source = FileSource(tmp_path / "a.h5", realtime=False)
    assert (source.channels, source.sample_rate) == ((force, response), 25600.0)
    source.start()
    again = tuple(capture_hits(source, TRIGGER))
    for hit, old in zip(again, tap.hits, strict=True):
        assert np.array_equal(hit.codes, old.codes)  # type: ignore[arg-type]
        assert (hit.lost_scans, hit.overload, hit.pre_trigger) == (old.lost_scans, old.overload, old.pre_trigger)
    assert tuple(map(check_hit, again)) == tap.flags


def test_the_real_beam_hit_comes_out_with_its_frf(beam: Path) -> None:
    (old,) = read_hits(beam)
    source = FileSource(beam, realtime=False)
    source.start()
    (hit,) = capture_hits(source, Trigger(5.0, 50_000, 20))
    assert not check_hit(hit) & (HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE)
    start = int(np.argmax(old.force)) - int(np.argmax(hit.force))
    assert start >= 0
    steps = [channel.scale for channel in source.channels]
    assert np.max(np.abs(hit.force[: 50_030 - start] - old.force[start:][:50_000])) <= 0.51 * steps[0]
    assert np.max(np.abs(hit.acceleration[: 50_030 - start] - old.acceleration[start:][:50_000])) <= 0.51 * steps[1]
    same_cut = replace(old, force=old.force[start:][:50_000], acceleration=old.acceleration[start:][:50_000])
    ours, theirs = estimate_frf([hit]), estimate_frf([replace(same_cut, pre_trigger=20)])
    assert ours.in_band((100, 6000)).receptance == pytest.approx(theirs.in_band((100, 6000)).receptance, rel=1e-3)


def test_a_recording_is_a_device_without_a_clock(beam: Path) -> None:
    source = FileSource(beam)
    assert source.identity == DeviceIdentity("replay of acceleration.lvm")
    assert (source.follows_clock, source.loss_detection, source.fault, list(source.events)) == (False, "", "", [])


def test_a_clipped_recording_is_clipped_again(clipped_beam: Path) -> None:
    source = FileSource(clipped_beam, realtime=False)
    source.start()
    (hit,) = capture_hits(source, Trigger(20.0, 20_000, 20))
    assert check_hit(hit) & HitFlags.OVERLOAD_RESPONSE
    assert not check_hit(hit) & HitFlags.OVERLOAD_FORCE


def test_an_frf_holds_no_hits(tmp_path: Path) -> None:
    path = tmp_path / "frf.csv"
    path.write_text("frequency_hz,real_m_per_n,imag_m_per_n\n" + "".join(f"{f},1e-8,1e-9\n" for f in range(1, 50)))
    with pytest.raises(DataError):
        FileSource(path)


def test_in_real_time_scans_come_when_they_are_due(
    tmp_path: Path, tapper: Callable[..., HammeredStructure], channels: Pair
) -> None:
    tap_file(tmp_path / "a.h5", tapper, channels)
    with FileSource(tmp_path / "a.h5") as source:
        source.start()
        threading.Timer(0.5, source.stop).start()
        began = time.monotonic()
        blocks = list(source.blocks())
        came, due = time.monotonic() - began, (blocks[-1].first_scan + 512) / 25600.0
        assert 0 < due <= came
        source.start()
        assert next(source.blocks()).first_scan == 0
    assert list(source.blocks()) == []
