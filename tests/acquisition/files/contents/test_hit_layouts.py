"""Hits in arrays of three axes, in groups and in numbered channels."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import nptdms
import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from recorded_hits import RATE, N, make_hits, put_hit

from acquisition import Description, Recording, convert, inspect_file, read_frf
from acquisition.files.contents.hit_layouts import AXES, suggest_axes

HITS = make_hits(5)
NAMED = ("force [N]", "acceleration [m/s^2]")
ORDERS = list(itertools.permutations(AXES))


def put_npy(path: Path, array: np.ndarray) -> None:
    with path.open("wb") as file:
        np.save(file, array)


def put_npz(path: Path, array: np.ndarray) -> None:
    with path.open("wb") as file:
        np.savez(file, data=array, fs=RATE)


def put_mat(path: Path, array: np.ndarray) -> None:
    scipy.io.savemat(path, {"data": array, "fs": RATE}, appendmat=False)


def put_hdf5(path: Path, array: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        file["run/data"] = array


def are(recording: Recording, hits: np.ndarray) -> bool:
    """Return whether a recording has exactly these hits."""
    recording.require_valid()
    assert [hit.sample_rate for hit in recording.hits] == pytest.approx([RATE] * len(hits))
    found = np.array([hit.signals for hit in recording.hits])
    return found.shape == hits.shape and np.allclose(found, hits, rtol=0, atol=1e-9)


def ordered(axes: tuple[str, ...], hits: np.ndarray = HITS) -> np.ndarray:
    return hits.transpose([AXES.index(axis) for axis in axes])


@pytest.mark.parametrize("axes", ORDERS)
@pytest.mark.parametrize(
    ("put", "suffix", "has_rate"),
    [(put_npy, ".npy", False), (put_npz, ".npz", True), (put_mat, ".mat", True), (put_hdf5, ".h5", False)],
)
def test_an_array_in_any_order_of_axes_is_the_hits_that_it_holds(
    tmp_path: Path, put: Callable[[Path, np.ndarray], None], suffix: str, has_rate: bool, axes: tuple[str, ...]
) -> None:
    path = tmp_path / f"a{suffix}"
    put(path, ordered(axes))
    rate = None if has_rate else RATE
    assert are(inspect_file(path, Description(axes=axes, columns=NAMED, rate=rate)), HITS)


@pytest.mark.parametrize("columns", [(), NAMED, ("force [N]=1", "acceleration [m/s^2]=2")])
def test_an_array_is_never_one_hit_without_a_word(tmp_path: Path, columns: tuple[str, ...]) -> None:
    put_npy(tmp_path / "a.npy", HITS)
    asked = inspect_file(tmp_path / "a.npy", Description(columns=columns, rate=RATE))
    assert "Description.axes, for example hits,channels,samples" in asked.problems
    assert asked.hits == ()
    assert ("Description.columns" in asked.problems) == (not columns)


@pytest.mark.parametrize("axes", ORDERS)
@pytest.mark.parametrize(("n_hits", "n_channels"), [(5, 2), (2, 4), (3, 3)])
def test_the_suggested_axes_are_those_of_the_array(axes: tuple[str, ...], n_hits: int, n_channels: int) -> None:
    hits = make_hits(n_hits)
    channels = np.stack([hits[:, 0], *[gain * hits[:, 1] for gain in range(1, n_channels)]], axis=1)
    assert suggest_axes(ordered(axes, channels)) == axes


def test_an_array_of_one_hit_needs_no_axes(tmp_path: Path) -> None:
    put_npy(tmp_path / "a.npy", HITS[:1])
    assert are(inspect_file(tmp_path / "a.npy", Description(columns=NAMED, rate=RATE)), HITS[:1])


@pytest.mark.parametrize("axes", [("hits", "samples"), ("hits", "channels", "channels"), ("time", "hits", "channels")])
def test_other_words_for_axes_are_rejected(tmp_path: Path, axes: tuple[str, ...]) -> None:
    put_npy(tmp_path / "a.npy", HITS)
    problems = inspect_file(tmp_path / "a.npy", Description(axes=axes, columns=NAMED, rate=RATE)).problems
    assert f"Description.axes {','.join(axes)}" in problems


def test_axes_do_not_apply_to_vectors_to_frfs_and_to_four_axes(tmp_path: Path) -> None:
    path = put_hit(tmp_path / "a.csv", HITS[0])
    assert "Omit Description.axes" in inspect_file(path, Description(axes=AXES)).problems
    np.savez(tmp_path / "frf.npz", freq=np.arange(1.0, 60.0), frf=np.exp(1j * np.ones((3, 2, 59))))
    frfs = Description(columns=("frequency=freq", "frf [m/N]=frf:2"))
    assert inspect_file(tmp_path / "frf.npz", frfs).frf is not None
    assert "Omit Description.axes" in inspect_file(tmp_path / "frf.npz", Description(axes=AXES)).problems
    put_npy(tmp_path / "four.npy", HITS.reshape(5, 2, 2, -1))
    assert "4 axes" in inspect_file(tmp_path / "four.npy").problems


def test_a_time_and_arrays_of_different_rank_share_the_hits(tmp_path: Path) -> None:
    path, time = tmp_path / "a.npz", np.arange(N) / RATE
    np.savez(path, t=time, exc=HITS[:, 0], resp=np.stack([HITS[:, 1], 3 * HITS[:, 1]], axis=1))
    columns = ("time [s]=t", "force [N]=exc", "acceleration [m/s^2]=resp:2")
    tripled = HITS * np.array([1, 3])[:, None]
    assert are(inspect_file(path, Description(axes=AXES, columns=columns)), tripled)
    other = tmp_path / "b.npz"
    np.savez(other, one=HITS, two=HITS[:-1])
    assert "4 hits" in inspect_file(other, Description(axes=AXES)).problems


def test_more_hits_than_signals_of_an_array_are_all_read(tmp_path: Path) -> None:
    hits = make_hits(70)[:, :, :600]
    np.savez(tmp_path / "a.npz", force=hits[:, 0], acceleration=hits[:, 1])
    said = Description(one_test=True, columns=("force [N]=force", "acceleration [m/s^2]=acceleration"), rate=RATE)
    assert are(inspect_file(tmp_path / "a.npz", said), hits)


def put_channels(path: Path, force: str, response: str, hits: np.ndarray = HITS) -> Path:
    """Write the channels of all hits as columns without a time; {} is the number of the hit."""
    columns = {
        name.format(k): row for k, hit in enumerate(hits, 1) for name, row in zip((force, response), hit, strict=True)
    }
    np.savetxt(path, np.column_stack([*columns.values()]), "%.12g", ",", header=",".join(columns), comments="")
    return path


@pytest.mark.parametrize(
    ("force", "response"),
    [
        ("Hammer_tap_{} [N]", "Top_tap_{} [m/s^2]"),
        ("F{} [N]", "A{} [m/s^2]"),
        ("{}_force [N]", "{}_acc [m/s^2]"),
        ("hit {}/hammer [N]", "hit {}/point 7 [m/s^2]"),
        ("run{} in 1 [N]", "run{} in 2 [m/s^2]"),
    ],
)
def test_numbered_channels_are_the_hits_of_one_tap_test(tmp_path: Path, force: str, response: str) -> None:
    path = put_channels(tmp_path / "a.csv", force, response)
    asked = inspect_file(path, Description(rate=RATE))
    assert "Description.one_test" in asked.problems
    assert asked.hits == ()
    assert are(inspect_file(path, Description(rate=RATE, one_test=True)), HITS)
    assert read_frf(path, Description(rate=RATE, one_test=True)).n_averages == len(HITS)


@pytest.mark.parametrize(
    "columns",
    [
        ("force [N]=in0_hit", "acceleration [m/s^2]=in1_hit"),
        ("force [N]=in0_hit_1", "acceleration [m/s^2]=in1_hit_1"),
        NAMED,
        NAMED * len(HITS),
    ],
)
def test_channels_without_a_kind_are_named_once_for_all_hits(tmp_path: Path, columns: tuple[str, ...]) -> None:
    path = put_channels(tmp_path / "a.csv", "in0_hit_{}", "in1_hit_{}")
    asked = inspect_file(path).problems
    assert [field in asked for field in ("Description.one_test", "Description.columns", "Description.rate")] == [
        True
    ] * 3
    assert are(inspect_file(path, Description(rate=RATE, one_test=True, columns=columns)), HITS)


def test_a_first_hit_without_a_number_belongs_to_the_numbered_ones(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    names = ["Force", "Acc", *(f"{name}.{k}" for k in range(1, 5) for name in ("Force", "Acc"))]
    np.savetxt(path, HITS.reshape(-1, N).T, "%.12g", ",", header=",".join(names), comments="")
    said = {"force_unit": "N", "unit": "m/s^2", "rate": RATE}
    assert "Description.one_test" in inspect_file(path, Description(**said)).problems  # type: ignore[arg-type]
    assert are(inspect_file(path, Description(one_test=True, **said)), HITS)  # type: ignore[arg-type]


def test_repeated_headings_are_hits_in_their_order(tmp_path: Path) -> None:
    path = put_channels(tmp_path / "a.csv", "Force [N]", "Acc [m/s^2]", HITS[:1])
    names = ["Force [N]", "Acc [m/s^2]"] * len(HITS)
    np.savetxt(path, HITS.reshape(-1, N).T, "%.12g", ",", header=",".join(names), comments="")
    assert are(inspect_file(path, Description(rate=RATE, one_test=True)), HITS)


def test_numbers_of_sensors_are_no_numbers_of_hits(tmp_path: Path) -> None:
    three = np.stack([HITS[0, 0], HITS[0, 1], 2 * HITS[0, 1]])
    path = put_hit(tmp_path / "a.csv", three, "time [s],force [N],acc 1 [m/s^2],acc 2 [m/s^2]")
    for one_test in (False, True):
        said = Description(response=2, one_test=one_test)
        assert are(inspect_file(path, said), three[None, ::2])
        assert "Description.response" in inspect_file(path, Description(one_test=one_test)).problems


@given(st.lists(st.integers(0, N // 3), min_size=2, max_size=4))
def test_zero_padding_is_no_part_of_a_hit(tmp_path_factory: pytest.TempPathFactory, lost: list[int]) -> None:
    padded = np.array(HITS[: len(lost)])
    for hit, count in zip(padded, lost, strict=True):
        hit[:, N - count :] = 0
    path = tmp_path_factory.mktemp("padded") / "a.npy"
    put_npy(path, padded)
    said = Description(axes=AXES, columns=NAMED, rate=RATE)
    assert are(inspect_file(path, said), padded[:, :, : N - max(lost)])


def test_a_broken_hit_is_named_and_the_others_are_used(tmp_path: Path) -> None:
    broken = np.array(HITS)
    broken[2, 1, 100] = np.nan
    put_npy(tmp_path / "a.npy", broken)
    found = inspect_file(tmp_path / "a.npy", Description(axes=AXES, columns=NAMED, rate=RATE))
    assert are(found, np.delete(HITS, 2, axis=0))
    assert [(remark.code, remark.about) for remark in found.remarks] == [("hit-left-out", "a.npy, hit 3")]
    assert found.n_found == len(HITS)
    put_npy(tmp_path / "a.npy", np.full_like(HITS, np.nan))
    none = inspect_file(tmp_path / "a.npy", Description(axes=AXES, columns=NAMED, rate=RATE))
    assert none.problems
    assert none.hits == ()


def test_groups_of_a_file_without_one_channel_leave_that_hit_out(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, hit in zip(("alpha", "beta", "gamma", "delta", "eps"), HITS, strict=True):
            file[f"{name}/force"] = hit[0]
            if name != "gamma":
                file[f"{name}/acc"] = hit[1]
    assert "Description.one_test" in inspect_file(path).problems
    said = Description(one_test=True, rate=RATE, columns=("force [N]=force", "acceleration [m/s^2]=acc"))
    found = inspect_file(path, said)
    assert len(found.hits) == 4
    assert [remark.code for remark in found.remarks] == ["hit-left-out"]


def groups_tdms(path: Path, names: list[str]) -> None:
    with nptdms.TdmsWriter(path) as writer:
        for name, hit in zip(names, HITS, strict=False):
            kinds: list[tuple[str, str, Any]] = [("force", "N", hit[0]), ("acceleration", "m/s^2", hit[1])]
            about = {"wf_increment": 1 / RATE}
            writer.write_segment(
                [nptdms.ChannelObject(name, kind, row, about | {"unit_string": unit}) for kind, unit, row in kinds]
            )


def groups_sep005(path: Path, names: list[str]) -> None:
    files = [put_hit(path.with_name(f"{name}.csv"), hit) for name, hit in zip(names, HITS, strict=False)]
    said = Description(hit_files=tuple(files[1:]))
    convert(files[0], path, said, hits=True)
    text = path.read_text()
    for number, name in enumerate(names, 1):
        text = text.replace(f'"hit {number}"', f'"{name}"')
    path.write_text(text)


@pytest.mark.parametrize(("put", "suffix"), [(groups_tdms, ".tdms"), (groups_sep005, ".json")])
def test_named_groups_are_machines_unless_they_are_said_to_be_hits(
    tmp_path: Path, put: Callable[[Path, list[str]], None], suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    put(path, ["first", "second", "third"])
    assert "Description.one_test" in inspect_file(path).problems
    assert are(inspect_file(path, Description(one_test=True)), HITS[:3])
    put(path, ["hit 1", "hit 2"])
    assert are(inspect_file(path), HITS[:2])


def test_hits_without_a_force_are_found_by_a_word(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    names = [f"acc_tap_{k} [m/s^2]" for k in range(1, 6)]
    np.savetxt(path, HITS[:, 1].T, "%.12g", ",", header=",".join(names), comments="")
    said = Description(one_test=True, rate=RATE, without_force=True)
    assert [hit.has_force for hit in inspect_file(path, said).require_valid().hits] == [False] * 5


@pytest.mark.parametrize("shape", [(5, 2, N), (5, N)])
def test_a_complex_array_is_no_array_of_hits(tmp_path: Path, shape: tuple[int, ...]) -> None:
    array = HITS.reshape(5, -1, N)[:, : shape[1] if len(shape) == 3 else 1].reshape(shape)
    said = Description(axes=AXES, columns=NAMED if len(shape) == 3 else ("force [N]=array",), rate=RATE)
    put_npy(tmp_path / "a.npy", array + 0.5j)
    problems = inspect_file(tmp_path / "a.npy", said).problems
    assert "Description.axes hits,channels,samples: the array is complex" in problems
    put_npy(tmp_path / "a.npy", HITS.astype(complex))
    assert are(inspect_file(tmp_path / "a.npy", Description(axes=AXES, columns=NAMED, rate=RATE)), HITS)


@pytest.mark.parametrize("axes", ORDERS)
def test_an_empty_hit_does_not_change_the_suggested_axes(axes: tuple[str, ...]) -> None:
    hits = make_hits(10)
    for value in (0.0, 0.1, np.nan):
        hits[3] = value
        assert suggest_axes(ordered(axes, hits)) == axes
    assert sorted(suggest_axes(ordered(axes, np.zeros((5, 2, N))))) == sorted(AXES)


def test_the_rate_is_not_asked_for_where_it_is_given(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", one=HITS[:, 0], two=HITS[:, 1])
    asked = [inspect_file(tmp_path / "a.npz", Description(one_test=True, rate=rate)).problems for rate in (None, RATE)]
    assert ["Description.columns" in problems for problems in asked] == [True, True]
    assert ["Description.rate" in problems for problems in asked] == [True, False]


def test_arrays_without_hits_or_with_few_samples_are_rejected(tmp_path: Path) -> None:
    said = Description(axes=AXES, columns=NAMED, rate=RATE)
    put_npy(tmp_path / "a.npy", np.zeros((0, 2, 500)))
    assert inspect_file(tmp_path / "a.npy", said).problems == "the file has no columns of numbers"
    put_npy(tmp_path / "a.npy", np.ones((3, 2, 5)))
    problems = inspect_file(tmp_path / "a.npy", said).problems
    assert all(part in problems for part in ("Description.axes", "5 samples", "at least 8"))
    np.savez(tmp_path / "b.npz", force=HITS[0, 0, :5], acceleration=HITS[0, 1, :5])
    columns = ("force [N]=force", "acceleration [m/s^2]=acceleration")
    assert "5 samples" in inspect_file(tmp_path / "b.npz", Description(columns=columns, rate=RATE)).problems
