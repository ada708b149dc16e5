"""UFF in binary, MATLAB v5 and v7.3 in several layouts, WAV, TDMS; cut short at any byte."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.io.wavfile

from acquisition import DataError, Description, Hit, inspect_file, read_frf, read_hits
from acquisition.files.convert import EXPORT_FORMATS, ExportLabels

F = np.arange(0.0, 100.0, 2.0)
H = 1e-6 / (1 + 0.2j * F)


def uff_with(path: Path, *, binary: bool = False, unit: str = "m/s^2", direction: tuple[int, int] = (1, 1)) -> Path:
    """Write an accelerance of H as the format demands; binary: little endian, double."""
    pairs = np.stack([H.real, H.imag], axis=1).ravel()
    body = pairs.astype("<f8").tobytes() if binary else b"\n".join(b"%20.11E" % v for v in pairs) + b"\n"
    first = f"    58b     1     2{11:12d}{len(body):12d}     0     0           0           0" if binary else "    58"
    points = "".join(f" {'NONE':10s}{1:10d}{one:4d}" for one in direction)
    head = [
        "    -1",
        first,
        "Fräse",
        "NONE",
        "01-May-24 09:30:00",
        "NONE",
        "number of averages: 7",
        f"{4:5d}{0:10d}{0:5d}{0:10d}{points}",
        f"{6:10d}{F.size:10d}{1:10d}{0.0:13.5E}{2.0:13.5E}{0.0:13.5E}",
        f"{18:10d}{0:5d}{0:5d}{0:5d} {'Frequency':20s} {'Hz':20s}",
        f"{12:10d}{0:5d}{0:5d}{0:5d} {'Acceleration':20s} {unit:20s}",
        f"{13:10d}{0:5d}{0:5d}{0:5d} {'Force':20s} {'N' if unit != 'NONE' else 'NONE':20s}",
        f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}",
    ]
    path.write_bytes("\n".join(head).encode("latin-1") + b"\n" + body + b"    -1\n")
    return path


@pytest.mark.parametrize("binary", [True, False])
def test_uff_ascii_and_binary_hold_the_same(tmp_path: Path, binary: bool) -> None:
    found = inspect_file(uff_with(tmp_path / "a.uff", binary=binary)).require_valid()
    assert found.frf is not None
    assert found.frf.accelerance == pytest.approx(H[1:], rel=1e-10)
    assert found.frf.n_averages == 7
    assert found.direction == "x"
    assert f"{found.created:%Y-%m-%d}" == "2024-05-01"


def test_a_hammer_against_the_axis_turns_the_frf_round(tmp_path: Path) -> None:
    turned = read_frf(uff_with(tmp_path / "a.uff", direction=(2, -2)))
    assert turned.accelerance == pytest.approx(-H[1:], rel=1e-10)
    assert inspect_file(tmp_path / "a.uff").direction == "y"


def test_uff_without_units_asks_or_takes_its_unit_system(tmp_path: Path) -> None:
    path = uff_with(tmp_path / "a.uff", unit="NONE")
    assert "Description.unit" in inspect_file(path).problems
    assert "a unit of displacement" in inspect_file(path, Description(unit="m/N")).problems
    assert read_frf(path, Description(unit="g/N")).accelerance == pytest.approx(9.80665 * H[1:], rel=1e-10)
    system = (
        "    -1\n   164\n         9mm, newton                   2\n  1.0D+03  1.0D+00  1.0D+00\n  0.0D+00\n    -1\n"
    )
    path.write_bytes(system.encode() + path.read_bytes())
    assert read_frf(path).accelerance == pytest.approx(1e-3 * H[1:], rel=1e-10)


def mat_73(path: Path, variables: dict[str, Any]) -> Path:
    """Write a file as MATLAB -v7.3 does: HDF5 behind a header of 512 bytes, transposed, complex as pairs."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            values = np.atleast_2d(value).T
            if np.iscomplexobj(values):
                pairs = np.empty(values.shape, [("real", "f8"), ("imag", "f8")])
                pairs["real"], pairs["imag"] = values.real, values.imag
                values = pairs
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    return path


LAYOUTS: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"freq": F, "frf": H}, ()),
    ({"f": F, "H": np.stack([H, H], axis=1)}, ("frequency=f", "frf=H:1")),
    ({"abc": F, "re": H.real, "im": H.imag}, ("frequency [Hz]=abc", "real=re", "imag=im")),
]


@pytest.mark.parametrize(("variables", "columns"), LAYOUTS)
@pytest.mark.parametrize("newer", [True, False])
def test_mat_files_of_any_layout(
    tmp_path: Path, newer: bool, variables: dict[str, Any], columns: tuple[str, ...]
) -> None:
    path = tmp_path / "a.mat"
    if newer:
        mat_73(path, variables)
    else:
        scipy.io.savemat(path, variables)
    frf = read_frf(path, Description(columns=columns, unit="m/N"))
    assert frf.receptance == pytest.approx(H, rel=1e-14)
    assert frf.frequency == pytest.approx(F)


def test_structs_with_their_axis_and_unit(tmp_path: Path) -> None:
    struct = {
        "x_values": {"start_value": 0.0, "increment": 2.0, "number_of_values": F.size},
        "y_values": {"values": H[:, None], "quantity": {"label": "(m/s^2)/N"}},
    }
    scipy.io.savemat(tmp_path / "a.mat", {"FRF": struct})
    frf = read_frf(tmp_path / "a.mat")
    assert frf.frequency == pytest.approx(F[1:])
    assert frf.accelerance == pytest.approx(H[1:])


def test_signal_calc_has_the_frequency_in_the_first_column(tmp_path: Path) -> None:
    variables = {f"H1_{i}": np.stack([F + 0j, i * H], axis=1) for i in (2, 3)}
    variables |= {f"C1_{i}": np.stack([F, np.full(F.size, 0.1 * i)], axis=1) for i in (2, 3)}
    names = np.array(["hammer", "tip", "nut"], dtype=object)
    units = np.array(["N", "m/s^2", "g"], dtype=object)
    scipy.io.savemat(
        tmp_path / "a.mat", {**variables, "ChanName": names, "Unit": units, "X1": np.stack([F, F], axis=1)}
    )
    assert "1 H1_2 tip, 2 H1_3 nut" in inspect_file(tmp_path / "a.mat").problems
    frf = read_frf(tmp_path / "a.mat", Description(response=2))
    assert frf.accelerance == pytest.approx(3 * 9.80665 * H[1:])
    assert frf.coherence == pytest.approx(0.3)


def test_vectors_over_time_with_a_rate(tmp_path: Path) -> None:
    force, acceleration = np.sin(np.arange(50.0)), np.cos(np.arange(50.0))
    scipy.io.savemat(tmp_path / "a.mat", {"fs": 2048.0, "force": force, "acc": acceleration})
    assert "Description.force_unit" in inspect_file(tmp_path / "a.mat").problems
    (hit,) = read_hits(tmp_path / "a.mat", Description(unit="g", force_unit="lbf"))
    assert hit.sample_rate == 2048
    assert hit.force == pytest.approx(force * 4.4482216152605)


def test_a_text_with_the_name_of_a_sound_file_is_no_sound(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_text("time [s],force [N]\n0,1\n")
    with pytest.raises(DataError, match="WAV"):
        read_hits(tmp_path / "a.wav")


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.float32])
def test_wav_by_its_full_scale(tmp_path: Path, kind: type) -> None:
    shares = np.stack([0.5 * np.sin(np.arange(4000) / 9), 0.25 * np.cos(np.arange(4000) / 7)], axis=1)
    top = 1 if kind is np.float32 else -float(np.iinfo(kind).min)
    scipy.io.wavfile.write(tmp_path / "a.wav", 48000, (shares * top).astype(kind))
    assert (
        "Description.full_scale, for example 500,50"
        in inspect_file(tmp_path / "a.wav", Description(columns=("force [N]", "acceleration [g]"))).problems
    )
    said = Description(columns=("force [N]", "acceleration [m/s^2]"), full_scale=(500.0, 50.0))
    (hit,) = read_hits(tmp_path / "a.wav", said)
    assert hit.force == pytest.approx(500 * shares[:, 0], abs=500 / 32768)
    assert hit.acceleration == pytest.approx(50 * shares[:, 1], abs=50 / 32768)
    assert hit.sample_rate == 48000


def test_tdms_with_units_and_without_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    channels = [
        nptdms.ChannelObject("tap", name, np.sin(np.arange(64.0)), {"unit_string": unit, "wf_increment": 1 / 25600})
        for name, unit in (("Hammer", "N"), ("Tip", "g"))
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)
    (hit,) = read_hits(path)
    assert hit.sample_rate == pytest.approx(25600)
    assert hit.acceleration == pytest.approx(9.80665 * hit.force)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(DataError, match=r'pip install "lobewatch\[tdms\]"'):
        inspect_file(path)


TWICE = np.sort(np.append(np.arange(63.0), 20.0)) / 25600
"""Times of 64 samples, one of them twice."""


def over_time_uff(path: Path, time: np.ndarray, force: np.ndarray, response: np.ndarray) -> None:
    """Two signals with an abscissa of their own, as the format has it."""
    sets = []
    for node, (kind, unit, values) in enumerate(((13, "N", force), (12, "m/s^2", response)), 1):
        head = [
            "    -1",
            "    58",
            *5 * ["NONE"],
            f"{1:5d}{0:10d}{0:5d}{0:10d} {'NONE':10s}{node:10d}{1:4d} {'NONE':10s}{0:10d}{0:4d}",
            f"{4:10d}{time.size:10d}{0:10d}{0.0:13.5E}{0.0:13.5E}{0.0:13.5E}",
            f"{17:10d}{0:5d}{0:5d}{0:5d} {'Time':20s} {'s':20s}",
            f"{kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}",
            *2 * [f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {'NONE':20s}"],
        ]
        rows = [f"{t:20.11E}{value:20.11E}" for t, value in zip(time, values, strict=True)]
        sets.append("\n".join([*head, *rows, "    -1\n"]))
    path.write_text("".join(sets))


def over_time_mat(path: Path, time: np.ndarray, force: np.ndarray, response: np.ndarray) -> None:
    scipy.io.savemat(path, {"time": time, "force": force, "acc": response})


def over_time_mat_with_rate(path: Path, time: np.ndarray, force: np.ndarray, response: np.ndarray) -> None:
    scipy.io.savemat(path, {"fs": 25600.0, "time": time, "force": force, "acc": response})


def over_time_tdms(path: Path, time: np.ndarray, force: np.ndarray, response: np.ndarray) -> None:
    nptdms = pytest.importorskip("nptdms")
    named = (("Time", "s", time), ("Hammer", "N", force), ("Tip", "m/s^2", response))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("tap", name, values, {"unit_string": unit}) for name, unit, values in named]
        )


def over_time_sep005(path: Path, time: np.ndarray, force: np.ndarray, response: np.ndarray) -> None:
    named = (("hammer", "N", force), ("tip", "m/s^2", response))
    channels = [
        {"name": name, "unit_str": unit, "data": one.tolist(), "time": time.tolist()} for name, unit, one in named
    ]
    path.write_text(json.dumps(channels))


@pytest.mark.parametrize(
    ("make", "suffix"),
    [
        (over_time_uff, ".uff"),
        (over_time_mat, ".mat"),
        (over_time_mat_with_rate, ".mat"),
        (over_time_tdms, ".tdms"),
        (over_time_sep005, ".json"),
    ],
    ids=["uff", "mat", "mat with a rate", "tdms", "sep005"],
)
def test_a_time_that_is_there_twice_is_rejected(tmp_path: Path, make: Callable[..., None], suffix: str) -> None:
    path, signals = tmp_path / f"a{suffix}", np.random.default_rng(1).normal(size=(2, 64))
    said = Description(unit="g", force_unit="N") if suffix == ".mat" else Description()
    make(path, TWICE, *signals)
    with pytest.raises(DataError, match="uneven"):
        read_hits(path, said)
    make(path, np.arange(64.0) / 25600, *signals)
    assert "uneven" not in inspect_file(path, said).problems


def test_a_frequency_that_is_there_twice_is_rejected(tmp_path: Path) -> None:
    twice = np.where(F == 20, 18, F)
    said = Description(columns=("frequency=f", "frf=H"), unit="m/N")
    for make in (scipy.io.savemat, mat_73):
        make(tmp_path / "a.mat", {"f": twice, "H": H})
        with pytest.raises(DataError, match="frequency must"):
            read_frf(tmp_path / "a.mat", said)


def one_of_each(folder: Path) -> dict[str, Path]:
    """Write a small sound file of each format."""
    generator = np.random.default_rng(1)
    hit = Hit(generator.normal(size=60), generator.normal(size=60), 1000.0)
    made = {}
    for extension, writer in EXPORT_FORMATS.items():
        made[extension] = folder / f"sound{extension}"
        made[extension].write_bytes(writer.encode_hits([hit], ExportLabels()))
    made["binary"] = uff_with(folder / "binary.uff", binary=True)
    made["7.3"] = mat_73(folder / "newer.mat", {"freq": F[:20], "frf": H[:20]})
    made[".wav"] = folder / "sound.wav"
    scipy.io.wavfile.write(made[".wav"], 1000, generator.normal(size=(60, 2)).astype(np.float32))
    return made


def test_a_file_that_is_cut_short_is_rejected_or_asks_and_never_gives_other_numbers(tmp_path: Path) -> None:
    for kind, path in one_of_each(tmp_path).items():
        content, cut = path.read_bytes(), tmp_path / f"cut{path.suffix}"
        said = (
            Description(columns=("force [N]", "acceleration [g]"), full_scale=(1, 1))
            if kind == ".wav"
            else Description()
        )
        whole = inspect_file(path, said)
        cuts = 5 if path.suffix == ".mat" else 40  # each is read by a program of its own first
        for end in {*range(1, len(content) - 2, max(len(content) // cuts, 1)), len(content) - 3}:
            cut.write_bytes(content[:end])
            try:
                found = inspect_file(cut, said)
            except DataError:
                continue
            if found.problems:
                continue
            assert found.frf is None, (kind, end)
            assert [hit.force.tolist() for hit in found.hits] == [hit.force.tolist() for hit in whole.hits], (kind, end)


def test_a_mat_file_on_which_its_reader_crashes_is_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"freq": F, "frf": H})
    assert not inspect_file(path, Description(unit="m/N")).problems
    monkeypatch.setattr(sys, "executable", "false")
    with pytest.raises(DataError, match="hangs"):
        inspect_file(path)


def test_a_small_mat_file_that_unpacks_to_much_is_rejected_unread(tmp_path: Path) -> None:
    path = mat_73(tmp_path / "bomb.mat", {"freq": F, "frf": H})
    with h5py.File(path, "r+") as file:
        file.create_dataset("big", shape=(100_000_000,), dtype="f8", chunks=(100_000,), compression="gzip")
    with pytest.raises(DataError, match=r"bomb\.mat: .* MB .* 800"):
        inspect_file(path)
