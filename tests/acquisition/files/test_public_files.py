"""Files written by other programs: the content read from each, or the questions raised."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from acquisition import DataError, Description, inspect_file, read_frf, read_hits

DATA = Path(__file__).parents[2] / "data"


def test_an_analysers_mat_file_with_frf_and_coherence() -> None:
    path = DATA / "vibrationtesting" / "case1.mat"
    missing = re.findall(r"\S+ \(give Description.*?\)", inspect_file(path).problems)
    assert missing == ["Hf_chan_2 (give Description.unit, for example m/N, um/N or g/N)"]
    frf = read_frf(path, Description(unit="m/s^2/N", averages=10))
    raw = scipy.io.loadmat(path, squeeze_me=True)
    assert frf.frequency == pytest.approx(raw["Freq_domain"][1:])
    assert frf.accelerance == pytest.approx(raw["Hf_chan_2"][1:], rel=1e-12)
    assert frf.coherence is not None
    coherence = raw["Hf_coh_chan_2"][1:]
    assert frf.coherence == pytest.approx(np.where(coherence > 1, 0, coherence), abs=1e-9)
    assert frf.n_averages == 10


def test_the_hit_next_to_it_is_taken_by_its_names() -> None:
    columns = ("time [s]=Time_domain", "force [N]=Time_chan_1", "acceleration [g]=Time_chan_2")
    (hit,) = read_hits(DATA / "vibrationtesting" / "case1.mat", Description(columns=columns))
    assert hit.force.size == 4096
    assert hit.sample_rate == pytest.approx(1280, rel=1e-4)


def test_receptances_of_several_points_in_big_endian() -> None:
    path = DATA / "vibrationtesting" / "mckiddat.mat"
    said = inspect_file(path).problems
    assert "3 FRFs: 1 Recep:1, 2 Recep:2, 3 Recep:3 (give Description.response, for example 1)" in said
    assert "Description.unit" in said
    frf = read_frf(path, Description(response=2, unit="m/N"))
    assert frf.receptance == pytest.approx(scipy.io.loadmat(path)["Recep"][:, 1])


def test_a_loggers_transfer_function_has_its_lines_from_rate_and_length() -> None:
    path = DATA / "pydvma" / "jw_tf_coh.mat"
    frf = read_frf(path, Description(unit="m/s/N"))
    assert frf.frequency[:2] == pytest.approx([2000 / 1024, 2 * 2000 / 1024])
    assert frf.mobility[4] == pytest.approx(scipy.io.loadmat(path)["yspec"][5, 0])
    assert frf.coherence is not None
    with pytest.raises(DataError, match=r"Description.force"):
        read_hits(DATA / "pydvma" / "jw_time.mat")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Sample_UFF58b_bin.uff", "a hit needs a force"),
        ("binary8byte.uff", r"sine 5 Hz 1 \[g\] over time"),
        ("dataset_milestone_in_header.uff", "42 of 2508876 numbers"),
        ("sample_dataset58_psd.uff", "functions of type 9"),
        ("time-history-not-all-columns-filled.uff", r"1x \[m/s²\] over time"),
    ],
)
def test_uff_files_that_are_no_tap_test_say_why(name: str, said: str) -> None:
    with pytest.raises(DataError, match=said):
        read_frf(DATA / "pyuff_uff58" / name)


def test_a_uff_frf_with_signs_that_are_no_ascii() -> None:
    recording = inspect_file(DATA / "pyuff_uff58" / "non_ascii_header.uff")
    assert not recording.problems
    assert recording.frf is not None
    assert recording.frf.accelerance == pytest.approx(
        [
            -0.0599924 - 0.0553260j,
            0.025875 - 0.000230085j,
            -0.299003 + 0.317213j,
            -1.8025 + 1.55302j,
            3.75037 + 2.93363j,
        ]
    )
    assert recording.frf.frequency == pytest.approx(0.195313 * np.arange(1, 6))
    assert f"{recording.created:%Y-%m-%d %H:%M:%S}" == "2017-03-23 19:02:23"


def lengthened(name: str, n: int) -> str:
    """Write an LVM file with as many rows as its header states."""
    text = (DATA / "lvm_read" / name).read_text("latin-1")
    head, rows = text.rsplit("X_Value", 1)[0], text.rsplit("X_Value", 1)[1].splitlines()
    values = [row for row in rows[1:] if row.strip()]
    made = "\n".join(values[i % len(values)] for i in range(n))
    old = next(line for line in head.splitlines() if line.startswith("Samples"))
    new = "\t".join(word if word in ("Samples", "", "0") else str(n) for word in old.split("\t"))
    return f"{head.replace(old, new)}X_Value{rows[0]}\n{made}\n"


def test_lvm_with_a_time_column_for_each_channel(tmp_path: Path) -> None:
    path = tmp_path / "multi.lvm"
    text = lengthened("multi_time_column.lvm", 12).replace("Volts", "N")
    path.write_text(text, encoding="latin-1")
    (hit,) = read_hits(path)
    assert hit.force[:3] == pytest.approx([-0.035229, -0.034882, -0.034191])
    assert hit.acceleration[:2] == pytest.approx(np.array([0.532608, 0.502991]) * 9.80665)
    assert hit.sample_rate == pytest.approx(51200)


def test_lvm_with_empty_channels_and_several_responses(tmp_path: Path) -> None:
    path = tmp_path / "empty.lvm"
    path.write_text(lengthened("with_empty_fields.lvm", 10), encoding="latin-1")
    assert "columns Dev0/Ai0, Dev0/Ai2, Dev0/Ai0 1 (give Description.columns" in inspect_file(path).problems
    (hit,) = read_hits(path, Description(columns=("acceleration [g]", "force [N]", "-")))
    assert hit.force[0] == pytest.approx(7.254639)
    three = tmp_path / "three.lvm"
    three.write_text(lengthened("no_decimal_separator.lvm", 10), encoding="latin-1")
    assert "1 ax, 2 ay, 3 az (give Description.response, for example 1)" in inspect_file(three).problems
    columns = ("force [N]=ax", "acceleration [g]=az")
    assert read_hits(three, Description(columns=columns))[0].acceleration[0] == pytest.approx(0.021503 * 9.80665)


@pytest.mark.parametrize("name", sorted(path.name for path in (DATA / "lvm_read").glob("*.lvm")))
def test_lvm_files_as_they_are_say_why_they_are_no_hit(name: str) -> None:
    with pytest.raises(DataError, match=r"\d+ of \d+ samples|no force channel|Description.columns"):
        read_hits(DATA / "lvm_read" / name)
