"""Written for other programs and read back: the same within the precision that is stated; read by others, too."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition import (
    DataError,
    Description,
    Frf,
    Hit,
    TapTest,
    convert,
    from_accelerance,
    inspect_file,
    read_hits,
    write_tap,
)
from acquisition.files.convert import EXPORT_FORMATS, ExportLabels
from acquisition.frf import FrfQuantity
from acquisition.tap_test import Circumstances, new_tap_id

NOTHING = Description()
WHEN = datetime(2024, 5, 1, 9, 30, tzinfo=UTC)
OF_FRF = [".uff", ".csv", ".mat"]


@st.composite
def frfs(draw: st.DrawFn) -> Frf:
    """Any FRF: even or uneven lines, of any form, large and small, with coherence or without."""
    n = draw(st.integers(2, 40))
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    steps = generator.uniform(0.1, 3, n) if draw(st.booleans()) else np.full(n, draw(st.floats(1e-3, 1e3)))
    frequency = np.cumsum(steps)
    pairs = generator.normal(size=2 * n) * 10.0 ** draw(st.integers(-12, 3))
    values = pairs.view(np.complex128)
    coherence = generator.uniform(0, 1, n) if draw(st.booleans()) else None
    form = draw(st.sampled_from(get_args(FrfQuantity)))
    made = Frf(frequency, values, coherence, draw(st.integers(1, 99)))
    return (
        replace(made, measured_as=form)
        if form != "accelerance"
        else from_accelerance(frequency, values, coherence, made.n_averages)
    )


@pytest.mark.parametrize("extension", OF_FRF)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(frf=frfs(), direction=st.sampled_from(["x", "y"]))
def test_an_frf_survives(extension: str, tmp_path: Path, frf: Frf, direction: str) -> None:
    writer = EXPORT_FORMATS[extension]
    assert writer.encode_frf is not None
    path = tmp_path / f"a{extension}"
    path.write_bytes(writer.encode_frf(frf, ExportLabels(WHEN, direction, 'mill; "20"')))
    found = inspect_file(path).require_valid()
    assert found.frf is not None
    digits = 2e-11 if extension == ".uff" else 1e-14
    scale = np.max(np.abs(frf.receptance))
    even = extension != ".uff" or np.ptp(np.diff(frf.frequency)) < 1e-9
    assert found.frf.frequency == pytest.approx(frf.frequency, rel=1e-12 if even else 6e-6)
    if even:
        assert np.max(np.abs(found.frf.receptance - frf.receptance) / np.abs(frf.receptance)) < 10 * digits
    assert np.max(np.abs(found.frf.receptance - frf.receptance)) < 2e-5 * scale
    assert (found.frf.coherence is None) == (frf.coherence is None)
    if frf.coherence is not None:
        assert found.frf.coherence == pytest.approx(frf.coherence, rel=1e-11, abs=1e-300)
    assert (found.frf.n_averages, found.frf.measured_as) == (frf.n_averages, frf.measured_as)
    assert (found.direction, found.created) == (direction, WHEN)
    assert found.tool in ('mill; "20"', 'mill, "20"')


def a_hit(number: int, n: int = 400) -> Hit:
    generator = np.random.default_rng(number)
    return Hit(generator.normal(size=n) * 100, generator.normal(size=n) * 1e3, 51200.0)


@pytest.mark.parametrize("extension", [".uff", ".mat", ".json"])
def test_hits_survive(extension: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{extension}"
    hits = [a_hit(1), a_hit(2), a_hit(3)]
    path.write_bytes(EXPORT_FORMATS[extension].encode_hits(hits, ExportLabels(WHEN, "y")))
    found = inspect_file(path).require_valid()
    assert len(found.hits) == 3
    for old, new in zip(hits, found.hits, strict=True):
        assert new.force == pytest.approx(old.force, rel=2e-11)
        assert new.acceleration == pytest.approx(old.acceleration, rel=2e-11)
        assert new.sample_rate == pytest.approx(51200, rel=1e-14)
    assert (found.direction, found.created) == ("y", WHEN)


def test_a_tap_file_becomes_each_format(tmp_path: Path) -> None:
    about = Circumstances("mill", WHEN, "cutter", "y")
    frequency = np.arange(4.0, 400.0, 4.0)
    values = np.asarray(1e-8 / (1 - (frequency / 200) ** 2 + 0.05j), dtype=np.complex128)
    frf = Frf(frequency, values, np.linspace(0.5, 1, frequency.size), 8)
    tap = tmp_path / "tap.h5"
    write_tap(tap, TapTest(new_tap_id(about), about, frf))
    for extension in OF_FRF:
        made = convert(tap, tmp_path / f"out{extension}", NOTHING)
        back = inspect_file(made.path).require_valid()
        assert back.frf is not None
        assert back.frf.receptance == pytest.approx(frf.receptance, rel=1e-10)
        assert (back.direction, back.tool, back.created) == ("y", "cutter", WHEN)
    with pytest.raises(DataError, match=r"FRF.*\.uff, \.unv, \.csv, \.mat"):
        convert(tap, tmp_path / "out.json", NOTHING)
    with pytest.raises(ValueError, match=r"out\.xyz: .*'\.xyz' .*\.uff, \.unv, \.csv, \.mat, \.json"):
        convert(tap, tmp_path / "out.xyz", NOTHING)
    with pytest.raises(ValueError, match="input file"):
        convert(tmp_path / "out.csv", tmp_path / "out.csv", NOTHING)


def test_a_real_hit_becomes_a_text_table_and_back(beam: Path, tmp_path: Path) -> None:
    made = convert(beam, tmp_path / "hit.csv", NOTHING, hits=True)
    (old,), (new,) = read_hits(beam), read_hits(made.path)
    assert np.array_equal(new.force, old.force)
    assert new.sample_rate == pytest.approx(old.sample_rate, rel=1e-12)


def test_sep005_has_what_the_guideline_asks_for(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(EXPORT_FORMATS[".json"].encode_hits([a_hit(1, 8)], ExportLabels(WHEN)))
    for one in json.loads(path.read_bytes()):
        assert {"data", "name", "unit_str", "fs"} <= one.keys()
        assert one["start_timestamp"] == "2024-05-01T09:30:00+00:00"


def test_sep005_in_g_is_converted_and_without_a_unit_asked_for(tmp_path: Path) -> None:
    path, hit = tmp_path / "a.json", a_hit(1, 16)
    channels = [
        {"data": hit.force.tolist(), "name": "hammer", "unit_str": "N", "fs": 1000.0},
        {"data": hit.acceleration.tolist(), "name": "acc", "unit_str": "g", "fs": 1000.0},
    ]
    path.write_text(json.dumps(channels))
    assert read_hits(path)[0].acceleration == pytest.approx(hit.acceleration * 9.80665)
    channels[1]["unit_str"] = ""
    path.write_text(json.dumps(channels))
    assert "unit of acc (give Description.unit" in inspect_file(path).problems
    del channels[1]["fs"]
    path.write_text(json.dumps(channels))
    with pytest.raises(DataError, match=r"channel 2 .*fs"):
        inspect_file(path)
