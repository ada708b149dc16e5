"""Hits of several files as one tap test: joined, compared, and left out by name."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from recorded_hits import RATE, N, make_hits, put_hit

from acquisition import (
    Circumstances,
    DataError,
    Description,
    Hit,
    HitFlags,
    Recording,
    TapTest,
    convert,
    estimate_frf,
    inspect_file,
    new_tap_id,
    read_frf,
    write_tap,
)
from acquisition.files.contents.join_hits import join_hits

HITS = make_hits(6)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    return [put_hit(tmp_path / f"hit {k}.csv", hit) for k, hit in enumerate(HITS, 1)]


def join(files: list[Path], **said: object) -> Recording:
    return inspect_file(files[0], Description(hit_files=tuple(files[1:]), **said))  # type: ignore[arg-type]


def left_out(recording: Recording) -> list[str]:
    return [remark.about for remark in recording.remarks if remark.code == "hit-left-out"]


def test_several_files_are_one_tap_test_with_the_frf_of_all_hits(files: list[Path]) -> None:
    joined = join(files).require_valid()
    assert np.array([hit.signals for hit in joined.hits]) == pytest.approx(HITS, abs=1e-9)
    assert (joined.n_found, joined.remarks) == (len(HITS), ())
    frf = read_frf(files[0], Description(hit_files=tuple(files[1:])))
    exact = estimate_frf([Hit(force, response, RATE) for force, response in HITS])
    assert frf.n_averages == len(HITS)
    assert frf.receptance == pytest.approx(exact.receptance, rel=1e-6, abs=1e-15)


def test_every_file_that_cannot_be_used_is_named_and_the_rest_is_used(files: list[Path]) -> None:
    put_hit(files[0], HITS[0], rate=2 * RATE)
    put_hit(files[2], HITS[2, :1], "time [s],force [N]")
    put_hit(files[3], HITS[3, :, : N // 3])
    files[4].write_text("")
    joined = join(files).require_valid()
    assert np.array([hit.signals for hit in joined.hits]) == pytest.approx(HITS[[1, 5]], abs=1e-9)
    assert sorted(left_out(joined)) == ["hit 1.csv, hit 1", "hit 3.csv", "hit 4.csv, hit 1", "hit 5.csv"]
    assert joined.n_found == len(HITS)


def test_files_in_different_units_are_converted_and_named(files: list[Path]) -> None:
    put_hit(files[5], HITS[5] / np.array([[1.0], [9.80665]]), "time [s],force [N],acceleration [g]")
    joined = join(files).require_valid()
    assert np.array([hit.signals for hit in joined.hits]) == pytest.approx(HITS, abs=1e-7)
    assert [(remark.code, remark.about) for remark in joined.remarks] == [("units-differ", "hit 6.csv")]
    unknown = put_hit(files[1], HITS[1], "time [s],force [N],acceleration")
    assert left_out(join(files)) == [unknown.name]


def test_what_all_files_lack_is_asked_for(tmp_path: Path) -> None:
    files = [put_hit(tmp_path / f"{k}.csv", hit, "time,force,acc") for k, hit in enumerate(HITS)]
    problems = join(files).problems
    assert [f"Description.{field}" in problems for field in ("unit", "force_unit", "rate")] == [True] * 3
    assert len(join(files, unit="m/s^2", force_unit="N", rate=RATE).require_valid().hits) == len(HITS)


def test_longer_hits_are_cut_to_the_shortest(files: list[Path]) -> None:
    put_hit(files[1], HITS[1, :, : N - 500])
    sizes = {hit.acceleration.size for hit in join(files).require_valid().hits}
    assert sizes == {N - 500}


def test_a_copy_of_a_hit_does_not_count_twice(files: list[Path], tmp_path: Path) -> None:
    copy = tmp_path / "copy.csv"
    copy.write_bytes(files[1].read_bytes())
    joined = join([*files, copy]).require_valid()
    assert len(joined.hits) == len(HITS)
    assert left_out(joined) == ["copy.csv, hit 1"]


def test_a_file_of_the_force_cannot_belong_to_several_files(files: list[Path]) -> None:
    with pytest.raises(DataError, match=r"Description\.force"):
        join(files[:2], force=files[2])


def test_frfs_and_missing_files_are_no_hits(files: list[Path], tmp_path: Path) -> None:
    frf = tmp_path / "frf.csv"
    convert(files[0], frf, Description())
    assert left_out(join([*files, frf]).require_valid()) == ["frf.csv"]
    assert join([frf, frf]).problems
    assert inspect_file(frf, Description(one_test=True)).require_valid().frf is not None
    with pytest.raises(FileNotFoundError):
        join([*files, tmp_path / "none.csv"])
    (tmp_path / "empty.csv").write_text("")
    assert join([tmp_path / "empty.csv"] * 2).problems


def test_files_of_two_directions_are_not_one_tap_test(files: list[Path], tmp_path: Path) -> None:
    made = []
    for direction, day, file in zip("xxy", (3, 2, 1), files, strict=False):
        out = tmp_path / f"{file.stem}.uff"
        said = Description(direction=direction, date=datetime(2026, 5, day, tzinfo=UTC))
        convert(file, out, said, hits=True)
        made.append(out)
    joined = join(made[:2]).require_valid()
    assert (joined.direction, joined.created) == ("x", datetime(2026, 5, 2, tzinfo=UTC))
    both = join(made)
    assert "x, y" in both.problems
    assert both.hits == ()
    with pytest.raises(DataError):
        read_frf(made[0], Description(hit_files=tuple(made[1:])))


def test_tap_files_of_lobewatch_are_joined_too(tmp_path: Path) -> None:
    made = []
    for k, part in enumerate((HITS[:2], HITS[2:])):
        hits = tuple(Hit(force, response, RATE, pre_trigger=50 + k) for force, response in part)
        about = Circumstances("mill", datetime(2026, 5, 1 + k, tzinfo=UTC))
        write_tap(
            tmp_path / f"{k}.h5",
            TapTest(new_tap_id(about), about, estimate_frf(hits), hits, (HitFlags.OK,) * len(hits)),
        )
        made.append(tmp_path / f"{k}.h5")
    joined = join(made).require_valid()
    assert np.array([hit.signals for hit in joined.hits]) == pytest.approx(HITS)
    assert {hit.pre_trigger for hit in joined.hits} == {0}
    assert read_frf(made[0], Description(hit_files=tuple(made[1:]))).n_averages == len(HITS)


def test_the_rate_of_most_hits_counts() -> None:
    hits = {str(k): Hit(HITS[k, 0], HITS[k, 1], RATE * (2 if k in (0, 3) else 1)) for k in range(5)}
    joined, remarks = join_hits(hits)
    assert [hit.sample_rate for hit in joined] == [RATE] * 3
    assert [remark.about for remark in remarks] == ["0", "3"]
    odd = {name: Hit(HITS[k, 0], HITS[k, 1], RATE * (1 + 1e-5 * k)) for k, name in enumerate("abc")}
    odd["a"] = Hit(np.empty(0), HITS[0, 1], RATE)
    joined, remarks = join_hits(odd)
    assert (len(joined), [remark.about for remark in remarks]) == (2, ["a"])


def test_hits_of_nearly_one_rate_get_the_same_rate_and_pre_trigger() -> None:
    time = np.arange(-100, 4000) / 10240.0
    force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 2, 0.0)
    rates = 10240.0, 10240.0, 10240.0001
    hits = {f"hit {i}": Hit(force + i, force * i, rate, 100) for i, rate in enumerate(rates, 1)}
    joined, remarks = join_hits(hits)
    assert [(hit.sample_rate, hit.pre_trigger) for hit in joined] == [(10240.0, 100)] * 3
    assert remarks == []


def test_only_units_that_differ_are_named(files: list[Path], tmp_path: Path) -> None:
    names = ("time [s],Hammer [N],Top [m/s^2]", "time [s],force [N],acceleration [m/s2]")
    for file, hit, heading in zip(files, HITS, names, strict=False):
        put_hit(file, hit, heading)
    convert(files[2], tmp_path / "tap.uff", Description(), hits=True)
    assert join([*files, tmp_path / "tap.uff"]).require_valid().remarks[1:] == ()
    scale = np.array([[4.4482216152605], [1.0]])
    put_hit(files[0], HITS[0] / scale, names[0].replace("[N]", "[lbf]"))
    (remark,) = join(files).require_valid().remarks
    assert (remark.code, remark.about) == ("units-differ", files[0].name)
    assert "lbf, m/s^2" in remark.text
    assert "Hammer" not in remark.text


def test_an_empty_first_file_is_left_out(files: list[Path]) -> None:
    files[0].write_text("")
    assert left_out(join(files).require_valid()) == [files[0].name]
    assert read_frf(files[0], Description(hit_files=tuple(files[1:]))).n_averages == len(HITS) - 1


def test_a_file_named_twice_is_left_out(files: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(files[0].parent)
    first, second = (Path(file.name) for file in files[:2])
    joined = join([first, second, first, first]).require_valid()
    assert (len(joined.hits), joined.n_found) == (2, 4)
    assert left_out(joined) == [f"{first} (2), hit 1", f"{first} (3), hit 1"]


def test_rate_and_force_of_most_hits_are_chosen_together() -> None:
    none = np.empty(0)
    hits = {str(k): Hit(HITS[k, 0] if k > 1 else none, HITS[k, 1], RATE * (1 if k < 2 else 2)) for k in range(4)}
    joined, remarks = join_hits(hits)
    assert [(hit.sample_rate, hit.has_force) for hit in joined] == [(2 * RATE, True)] * 2
    assert [remark.about for remark in remarks] == ["0", "1"]
    force, response = HITS[0]
    alike = {name: Hit(force, response, rate) for name, rate in zip("abc", (RATE, 2 * RATE, 2 * RATE), strict=True)}
    joined, remarks = join_hits(alike)
    assert ([hit.sample_rate for hit in joined], [remark.about for remark in remarks]) == ([2 * RATE], ["a", "c"])
