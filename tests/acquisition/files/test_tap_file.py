"""Tap files: bit-exact round trips, and named damage."""

from __future__ import annotations

import errno
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquisition import (
    Channel,
    Circumstances,
    Conditions,
    DataError,
    Frf,
    HammeredStructure,
    Hit,
    HitFlags,
    SimulatedSource,
    SourceFile,
    TapTest,
    Trigger,
    atomic_write,
    average_good_hits,
    capture_hits,
    new_tap_id,
    read_frf,
    read_hits,
    read_tap,
    read_tap_hits,
    write_hit,
    write_tap,
)
from acquisition.files.tap_file import read_hit_name, round_as_stored

ABOUT = Circumstances(
    "mill 3", datetime(2026, 1, 15, 9, 30, 0, 123456, UTC), "20 mm/ø", "y", "Kim", "[machine]\n", "DI-4108"
)
ABOUT = replace(ABOUT, conditions=Conditions(-4.5, 80.25, 18.0, "wärm", True, "note"))


@pytest.fixture
def tap(tapper: Callable[..., HammeredStructure], channels: tuple[Channel, Channel]) -> TapTest:
    """Ten hits, some of them rejected, with codes."""
    source = SimulatedSource(tapper(double_hits=0.3, overloads=0.2), channels, 25600.0, 120_000)
    hits = tuple(capture_hits(source, Trigger(20.0, 6400, 512)))
    hits = (*hits[:-1], replace(hits[-1], lost_scans=7))
    frf, flags = average_good_hits(hits)
    assert frf is not None
    assert 2 < frf.n_averages < len(hits) - 1
    return TapTest(new_tap_id(ABOUT), ABOUT, frf, hits, flags)


def same_hit(a: Hit, b: Hit) -> bool:
    return (
        np.array_equal(a.force, b.force)
        and np.array_equal(a.acceleration, b.acceleration)
        and (a.sample_rate, a.pre_trigger, a.lost_scans, a.channels)
        == (b.sample_rate, b.pre_trigger, b.lost_scans, b.channels)
    )


def same_frf(a: Frf, b: Frf) -> bool:
    return (
        np.array_equal(a.frequency, b.frequency)
        and np.array_equal(a.receptance, b.receptance)
        and np.array_equal(np.asarray(a.coherence), np.asarray(b.coherence))
        and (a.n_averages, a.measured_as, a.usable_band) == (b.n_averages, b.measured_as, b.usable_band)
    )


@pytest.mark.quick
def test_a_tap_test_is_read_back_to_the_bit(tap: TapTest, tmp_path: Path) -> None:
    path = tmp_path / "tap.h5"
    content = write_tap(path, tap)
    assert path.read_bytes() == content
    read = read_tap(path)
    assert (read.id, read.circumstances, read.flags, read.source) == (tap.id, tap.circumstances, tap.flags, None)
    assert all(map(same_hit, read.hits, tap.hits))
    assert tap.required_frf.coherence is not None
    assert same_frf(
        read.required_frf, replace(tap.required_frf, coherence=tap.required_frf.coherence.astype(np.float32))
    )
    assert same_frf(read.required_frf, round_as_stored(tap).required_frf)
    assert same_frf(read_frf(path), round_as_stored(tap).required_frf)
    assert all(map(same_hit, read_hits(path), tap.hits))
    assert HitFlags.LOST_SCANS in read.flags[-1]


def test_a_file_from_before_overloads_were_reported_is_read(tap: TapTest, tmp_path: Path) -> None:
    reported = (replace(tap.hits[0], overload=2), *tap.hits[1:])
    write_tap(tmp_path / "tap.h5", replace(tap, hits=reported))
    assert [hit.overload for hit in read_tap(tmp_path / "tap.h5").hits] == [2] + [0] * (len(tap.hits) - 1)
    with h5py.File(tmp_path / "tap.h5", "a") as file:
        del file["raw/overload"]
    assert not any(hit.overload for hit in read_tap(tmp_path / "tap.h5").hits)


def test_the_frf_can_be_made_again_from_the_stored_codes(tap: TapTest, tmp_path: Path) -> None:
    write_tap(tmp_path / "tap.h5", tap)
    again, flags = average_good_hits(read_tap(tmp_path / "tap.h5").hits)
    assert flags == tap.flags
    assert again is not None
    assert same_frf(again, tap.required_frf)


def test_a_recording_without_codes_keeps_its_samples_and_its_source(tap: TapTest, tmp_path: Path) -> None:
    bare = tuple(replace(hit, codes=None, channels=None) for hit in tap.hits)
    source = SourceFile("hits.lvm", bytes(range(256)))
    write_tap(tmp_path / "tap.h5", replace(tap, hits=bare, source=source))
    read = read_tap(tmp_path / "tap.h5")
    assert all(map(same_hit, read.hits, bare))
    assert read.source == source


def test_a_recorded_frf_has_no_hits(tmp_path: Path) -> None:
    frf = Frf(np.array([1.0, 2.0]), np.array([1.0, 1j]))
    write_tap(tmp_path / "tap.h5", TapTest("t", ABOUT, frf))
    read = read_tap(tmp_path / "tap.h5")
    assert (read.hits, read.flags) == ((), ())
    assert same_frf(read.required_frf, frf)


def test_the_file_is_plain_hdf5_with_units_and_scales(tap: TapTest, tmp_path: Path) -> None:
    write_tap(tmp_path / "tap.h5", tap)
    with h5py.File(tmp_path / "tap.h5") as file:
        assert file["raw/codes"].dtype == np.int16
        assert file["raw/codes"].attrs["units"] == "ADC code"
        assert file["raw/channel_0"].attrs["sensitivity"] == 2.25e-3
        assert file["frf/receptance"].attrs["units"] == "m/N"
        assert file["frf/receptance"].dims[0][0].name == "/frf/frequency"
        assert file["frf/coherence"].dtype == np.float32
        assert "spectra" not in file
        kinds: set[str] = set()
        file.visititems(lambda _, node: kinds.add(node.dtype.kind) if isinstance(node, h5py.Dataset) else None)
        assert "V" not in kinds


def test_a_hit_in_progress_is_read_back_with_its_circumstances(tap: TapTest, tmp_path: Path) -> None:
    write_hit(tmp_path / "0000.h5", tap.hits[0], ABOUT, HitFlags.UNDONE)
    (hit,), about, flags = read_tap_hits(tmp_path / "0000.h5")
    assert same_hit(hit, tap.hits[0])
    assert about == ABOUT
    assert flags == (HitFlags.UNDONE,)


def test_hits_in_progress_of_two_set_ups_keep_each_their_own(tap: TapTest, tmp_path: Path) -> None:
    first, second = tap.hits[:2]
    bare, later = replace(second, codes=None, channels=None, sample_rate=5120.0), replace(ABOUT, operator="Ida")
    written = [(first, ABOUT), (second, ABOUT), (second, later), (bare, later), (first, ABOUT)]
    for number, (hit, about) in enumerate(written):
        write_hit(tmp_path / f"{number:04d}.h5", hit, about, HitFlags.OK)
    for number, (hit, about) in enumerate(written):
        (read,), circumstances, _ = read_tap_hits(tmp_path / f"{number:04d}.h5")
        assert same_hit(read, hit)
        assert circumstances == about
        assert read_hit_name(tmp_path / f"{number:04d}.h5") == f"{number:04d}.h5"


@pytest.mark.parametrize("place", [0, 100, 4000, -200, -30])
def test_an_altered_hit_in_progress_is_reported_before_hdf5_sees_it(
    tap: TapTest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: int
) -> None:
    path = tmp_path / "0000.h5"
    write_hit(path, tap.hits[0], ABOUT, HitFlags.OK)
    content = bytearray(path.read_bytes())
    content[place] ^= 4
    path.write_bytes(content)
    monkeypatch.setattr(h5py, "File", None)
    with pytest.raises(DataError, match=r"0000\.h5: .*SHA-256"):
        read_tap_hits(path)


def test_identities_are_unique_file_names_that_sort_by_time() -> None:
    ids = {new_tap_id(ABOUT) for _ in range(50)}
    assert len(ids) > 40
    assert all(i.startswith("20260115T093000.123456Z_mill-3_20-mm_y_") for i in ids)


@pytest.mark.parametrize("keep", [0, 4, 1000, -200])
def test_a_truncated_file_is_rejected_by_name(tap: TapTest, tmp_path: Path, keep: int) -> None:
    path = tmp_path / "tap.h5"
    path.write_bytes(write_tap(path, tap)[:keep])
    with pytest.raises(DataError, match=r"tap\.h5"):
        read_tap(path)


@pytest.mark.parametrize("what", ["long", "in one chunk"])
def test_a_small_file_that_unpacks_to_much_is_rejected_unread(tap: TapTest, tmp_path: Path, what: str) -> None:
    """Zeros shrink a thousandfold: 800 MB fit into less than 1 MB."""
    write_tap(tmp_path / "bomb.h5", tap)
    count = 400_000_000
    with h5py.File(tmp_path / "bomb.h5", "r+") as file:
        del file["raw/codes"]
        shape = {"long": (10, 2, count // 20), "in one chunk": (10, 2, 100)}[what]
        limits, chunk = (None, None, None), (1, 1, 100_000) if what == "long" else (1, 1, count)
        file.create_dataset("raw/codes", shape, np.int16, maxshape=limits, chunks=chunk, compression="gzip")
    assert (tmp_path / "bomb.h5").stat().st_size < 1_000_000
    for read in (read_tap, read_tap_hits, read_frf):
        with pytest.raises(DataError, match=r"bomb\.h5: .* MB .* (800|1\.6e\+04)"):
            read(tmp_path / "bomb.h5")


def test_foreign_hdf5_is_no_tap_test(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(DataError, match="lobewatch-tap"):
        read_tap(tmp_path / "other.h5")
    with pytest.raises(DataError, match="no columns"):
        read_frf(tmp_path / "other.h5")


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    path = tmp_path / "file"
    atomic_write(path, b"old")

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os if call == "fsync" else Path, call, fail)
    with pytest.raises(OSError, match="No space left"):
        atomic_write(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_direction_that_is_none_and_a_time_without_zone_are_rejected() -> None:
    with pytest.raises(ValueError, match="direction='z'"):
        replace(ABOUT, direction="z")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no time zone"):
        replace(ABOUT, created=datetime(2026, 1, 1))  # noqa: DTZ001


@pytest.mark.parametrize(
    "beyond", [HitFlags.UNDONE, HitFlags.INCONSISTENT, HitFlags.NARROW_BAND, HitFlags.NOT_EVALUATED]
)
def test_hits_rejected_for_what_their_signals_do_not_show_stay_out_of_a_replay(
    tap: TapTest, tmp_path: Path, beyond: HitFlags
) -> None:
    flags = (beyond, *tap.flags[1:])
    write_tap(tmp_path / "tap.h5", replace(tap, flags=flags))
    read = read_hits(tmp_path / "tap.h5")
    assert len(read) == len(tap.hits) - 1
    assert same_hit(read[0], tap.hits[1])


def test_a_file_from_before_the_device_was_kept_is_read(tap: TapTest, tmp_path: Path) -> None:
    write_tap(tmp_path / "tap.h5", tap)
    assert read_tap(tmp_path / "tap.h5").circumstances.device == "DI-4108"
    with h5py.File(tmp_path / "tap.h5", "a") as file:
        del file.attrs["device"]
    assert read_tap(tmp_path / "tap.h5").circumstances.device == ""


def test_a_device_that_sends_a_zero_character_is_kept(tap: TapTest, tmp_path: Path) -> None:
    about = replace(ABOUT, device="DI\0-4108\x1b")
    write_tap(tmp_path / "tap.h5", replace(tap, circumstances=about))
    assert read_tap(tmp_path / "tap.h5").circumstances.device == "DI-4108\x1b"


def test_a_file_is_little_more_than_its_codes_and_its_frf(tap: TapTest, tmp_path: Path) -> None:
    content = write_tap(tmp_path / "tap.h5", tap)
    with h5py.File(tmp_path / "tap.h5") as file:
        codes = file["raw/codes"].id.get_storage_size()
        lines = file["frf/frequency"].size
    assert len(content) < codes + 24 * lines + 20_000


def test_the_five_lines_of_the_documentation_read_a_file(tap: TapTest, tmp_path: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "format.md"
    (lines,) = re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    write_tap(tmp_path / "TAP.h5", tap)
    names: dict[str, Any] = {}
    exec(lines.replace("TAP.h5", (tmp_path / "TAP.h5").as_posix()), names)
    np.testing.assert_array_equal(names["frequency"], tap.required_frf.frequency)
    np.testing.assert_array_equal(names["receptance"], tap.required_frf.receptance)
    np.testing.assert_allclose(names["force"], [hit.force for hit in tap.hits], rtol=1e-12)


@pytest.mark.skipif(shutil.which("h5dump") is None, reason="h5dump is not installed")
def test_h5dump_reads_a_file(tap: TapTest, tmp_path: Path) -> None:
    write_tap(tmp_path / "tap.h5", tap)
    said = subprocess.run(["h5dump", "-H", tmp_path / "tap.h5"], capture_output=True, text=True, check=True)
    assert 'DATASET "receptance"' in said.stdout
