"""The history of lobes: rows, HDF5 file, damage."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import ArrayLike

from lobes import SldHistory, read_history, write_history

SPEED = np.array([6000.0, 9000.0, 12000.0])
TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
DEPTHS = st.floats(1e-6, 1.0) | st.just(np.inf) | st.just(np.nan)


def history(rows: int = 2) -> SldHistory:
    whole = SldHistory(
        settings_hash="5f3a",
        software="lobewatch 0.1.0",
        speed_rpm=SPEED,
        columns={
            "time": np.array(["2026-01-05T09:00:00Z", "2026-02-04T09:30:00Z"]),
            "natural_frequency": np.array([[1722.0, 3010.0], [1715.5, np.nan]]),
            "bearing_stiffness": np.array([2.1e8, 2.0e8]),
        },
        depth={
            "reference": np.array([[1e-3, np.inf, 2e-3], [0.9e-3, 5e-3, 2e-3]]),
            "rough / pocket №3 .. ä": np.array([[np.inf] * 3, [1e-4] * 3]),
        },
        units={"natural_frequency": "Hz", "bearing_stiffness": "N/m"},
    )
    return SldHistory(
        whole.settings_hash,
        whole.software,
        whole.speed_rpm,
        {name: values[:rows] for name, values in whole.columns.items()},
        {name: values[:rows] for name, values in whole.depth.items()},
        whole.units,
    )


def assert_same(one: SldHistory, other: SldHistory) -> None:
    assert (one.settings_hash, one.software, one.units) == (other.settings_hash, other.software, other.units)
    np.testing.assert_array_equal(one.speed_rpm, other.speed_rpm)
    for mine, yours in ((one.columns, other.columns), (one.depth, other.depth)):
        assert list(mine) == list(yours)
        for name in mine:
            assert mine[name].dtype.kind == yours[name].dtype.kind
            np.testing.assert_array_equal(mine[name], yours[name])
            assert mine[name].shape == yours[name].shape


@st.composite
def histories(draw: st.DrawFn) -> SldHistory:
    n, m = draw(st.integers(0, 4)), draw(st.integers(1, 5))
    column = st.one_of(
        hnp.arrays(np.float64, n),
        hnp.arrays(np.float64, (n, draw(st.integers(0, 3)))),
        st.lists(TEXT, min_size=n, max_size=n).map(lambda texts: np.array(texts, dtype=np.str_)),
    )
    names = st.from_regex(r"[A-Za-zäß_]\w{0,9}", fullmatch=True).filter(str.isidentifier)
    columns = draw(st.dictionaries(names, column, max_size=4))
    return SldHistory(
        draw(TEXT),
        draw(TEXT),
        np.cumsum(draw(hnp.arrays(np.float64, m, elements=st.floats(1, 1e4)))),
        columns,
        draw(st.dictionaries(TEXT.filter(bool), hnp.arrays(np.float64, (n, m), elements=DEPTHS), max_size=3)),
        {name: draw(TEXT) for name in columns if draw(st.booleans())},
    )


@settings(max_examples=60, deadline=None)
@given(whole=histories())
def test_what_is_written_is_read(whole: SldHistory, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("history") / "history.h5"
    write_history(path, whole)
    assert_same(whole, read_history(path))


def test_append_adds_a_row_and_leaves_the_old_history_alone() -> None:
    old = history(1)
    full = history()
    new = old.append(
        {name: values[1] for name, values in full.columns.items()},
        {name: values[1] for name, values in full.depth.items()},
    )
    assert_same(full, new)
    assert (len(old), len(new)) == (1, 2)
    assert old.depth["reference"].shape == (1, 3)


def test_a_history_begins_with_no_rows(tmp_path: Path) -> None:
    path = tmp_path / "history.h5"
    write_history(path, history(0))
    empty = read_history(path)
    assert len(empty) == 0
    first: dict[str, ArrayLike] = {
        "time": "2026-01-05",
        "natural_frequency": [1722.0, 3010.0],
        "bearing_stiffness": 2e8,
    }
    one = empty.append(first, {name: np.full(3, np.inf) for name in empty.depth})
    assert one.columns["time"].tolist() == ["2026-01-05"]
    assert one.columns["natural_frequency"].tolist() == [[1722.0, 3010.0]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": "t"}, r"\['time'\].*bearing_stiffness"),
        ({"time": 3.0, "natural_frequency": [1.0, 2.0], "bearing_stiffness": 2e8}, "'time' .*float64"),
        ({"time": "t", "natural_frequency": [1.0], "bearing_stiffness": 2e8}, r"'natural_frequency' .*\(1,\).*\(2,\)"),
    ],
)
def test_rows_of_another_form_are_rejected(change: dict[str, Any], message: str) -> None:
    depth = {name: np.ones(3) for name in history().depth}
    with pytest.raises(ValueError, match=message):
        history().append(change, depth)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depth": {"": np.ones((2, 3))}}, "name"),
        ({"depth": {"a\0b": np.ones((2, 3))}}, r"'a\\x00b'"),
        ({"depth": {"half \ud800": np.ones((2, 3))}}, r"'half \\ud800'"),
        ({"depth": {"a": np.ones((2, 4))}}, r"'a' .*\(2, 4\).*\(n, 3\)"),
        ({"depth": {"a": np.zeros((2, 3))}}, "'a' .*> 0 m"),
        ({"depth": {"a": np.ones((1, 3))}}, "'a': 1"),
        ({"columns": {"a/b": np.ones(2)}}, "'a/b'"),
        ({"columns": {"a": np.array([None, "x"])}}, "'a' .*object"),
        ({"columns": {"a": np.ones((2, 3, 4))}, "units": {}}, r"'a' .*\(2, 3, 4\).*\(n,\) .*\(n, k\)"),
        ({"units": {"mass": "kg"}}, r"\['mass'\]"),
        ({"speed_rpm": np.array([3.0, 2.0, 4.0])}, "speed_rpm "),
        ({"speed_rpm": np.array([0.0, 2.0, 4.0])}, "speed_rpm\\[0\\]=0.0"),
    ],
)
def test_what_is_no_history_is_rejected(change: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {name: getattr(history(), name) for name in ("speed_rpm", "columns", "depth")}
    with pytest.raises(ValueError, match=message):
        SldHistory("hash", "software", **{**good, **change})


def test_the_file_explains_itself_to_other_programs(tmp_path: Path) -> None:
    path = tmp_path / "history.h5"
    write_history(path, history())
    with h5py.File(path, "r") as file:
        assert file.attrs["format"] == "lobewatch-history"
        assert file.attrs["version"] == 1
        assert file["speed_rpm"].attrs["units"] == "rpm"
        assert file["columns/natural_frequency"].attrs["units"] == "Hz"
        assert [cut.attrs["name"] for cut in file["cuts"].values()] == list(history().depth)
        depth = file["cuts/0/limiting_depth"]
        assert depth.attrs["units"] == "m"
        assert depth.dims[1][0] == file["speed_rpm"]
        assert h5py.check_string_dtype(file["columns/time"].dtype).encoding == "utf-8"


def test_more_than_ten_cuts_keep_their_order(tmp_path: Path) -> None:
    path = tmp_path / "history.h5"
    depth = {f"cut {i}": np.full((1, 3), 1e-3 * (i + 1)) for i in range(12)}
    write_history(path, SldHistory("", "", SPEED, {}, depth))
    assert {name: values[0, 0] for name, values in read_history(path).depth.items()} == {
        name: values[0, 0] for name, values in depth.items()
    }
    assert list(read_history(path).depth) == list(depth)


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "history.h5"
    write_history(path, history(1))

    def full_disk(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_history(path, history(2))
    assert len(read_history(path)) == 1
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_file_is_distinguished_from_a_bad_one(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_history(tmp_path / "history.h5")


def test_other_files_are_rejected(tmp_path: Path) -> None:
    path = tmp_path / "history.h5"
    path.write_text("speed,depth\n")
    with pytest.raises(ValueError, match=r"history\.h5: .*lobewatch-history"):
        read_history(path)
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "lobewatch-history"
    with pytest.raises(ValueError, match=r"history\.h5: .*lobewatch-history"):
        read_history(path)


@settings(max_examples=60, deadline=None)
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_damage_is_rejected(place: float, bit: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A flipped bit and a cut, anywhere."""
    path = tmp_path_factory.mktemp("damage") / "history.h5"
    write_history(path, history())
    sound = path.read_bytes()
    offset = int(place * len(sound))
    flipped = bytearray(sound)
    flipped[offset] ^= 1 << bit
    for damaged in (flipped, sound[:offset], sound + b"\0"):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"history\.h5"):
            read_history(path)
