"""Cells of a table: empty ones, and channels that end early."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from written_tables import FORCE, HIT, RESPONSE, F, H, complaint, is_h, numeral, put, rows

from acquisition import DataError, Description, inspect_file, read_frf, read_hits
from acquisition.files.read_cut import read_cut_recording

pytestmark = pytest.mark.quick

HEAD = "Time (s){0}Force (N){0}Acc (m/s^2){0}Temp\n"


def cells_of(separator: str, *changed: tuple[int, int, str], ends: Sequence[int] = (400, 400, 400, 400)) -> str:
    """Write the hit and a temperature with some cells (row, column, text) changed, each column up to its end."""
    cells = [[cell if i < end else "" for cell, end in zip(row, ends, strict=True)] for i, row in enumerate(HIT)]
    for row, column, text in changed:
        cells[row][column] = text
    return HEAD.format(separator) + "".join(separator.join(row) + "\n" for row in cells)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(("column", "name"), [(0, "Time"), (1, "Force"), (2, "Acc")])
def test_a_gap_in_a_column_that_is_used_is_rejected_with_its_place(
    tmp_path: Path, separator: str, column: int, name: str
) -> None:
    path = put(tmp_path / "a.csv", cells_of(separator, (40, column, "")))
    assert re.search(rf"\b{name} is empty in line 42\..* {name} .*Description\.columns", complaint(path))


@pytest.mark.parametrize("text", ["", "overflow", "1,234"])
def test_a_gap_in_a_column_that_is_not_used_does_not_matter(tmp_path: Path, text: str) -> None:
    path = put(tmp_path / "a.csv", cells_of(";", (40, 3, text), (0, 3, text)))
    (hit,) = read_hits(path)
    assert hit.force == pytest.approx(FORCE, abs=1e-7)
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-7)


def test_time_with_a_gap_is_left_out_and_the_rate_stated(tmp_path: Path) -> None:
    path = put(tmp_path / "a.csv", cells_of(",", (40, 0, "")))
    said = Description(columns=("-", "force [N]", "acceleration [m/s^2]", "-"), rate=4000)
    assert read_hits(path, said)[0].force == pytest.approx(FORCE, abs=1e-7)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ends", [(400, 300, 400, 400), (400, 400, 60, 400), (333, 350, 400, 10), (400, 301, 300, 40)])
@pytest.mark.parametrize("is_filled_up", [True, False])
def test_columns_are_cut_to_the_shortest_that_is_used(
    tmp_path: Path, separator: str, ends: tuple[int, ...], *, is_filled_up: bool
) -> None:
    lines = cells_of(separator, ends=ends).splitlines()
    text = "".join((line if is_filled_up else line.rstrip(separator)) + "\n" for line in lines)
    found = inspect_file(put(tmp_path / "a.csv", text)).require_valid()
    (hit,), n = found.hits, min(ends[:3])
    name = ("Time", "Force", "Acc")[ends.index(n)]
    (cut,) = (fact.value for fact in found.facts if fact.name == "rows" and fact.origin == "default")
    assert re.fullmatch(rf"{n} of {max(ends[:3])}, .*\b{name}\b.*", cut)
    assert hit.force == pytest.approx(FORCE[:n], abs=1e-7)
    assert hit.acceleration == pytest.approx(RESPONSE[:n], abs=1e-7)
    assert hit.sample_rate == pytest.approx(4000)


@pytest.mark.parametrize("n", [1, 3, 5])
@pytest.mark.parametrize("separator", [",", ";"])
def test_numbers_next_to_the_first_rows_are_notes_where_all_rows_have_as_many_cells(
    tmp_path: Path, separator: str, n: int
) -> None:
    path = put(tmp_path / "a.csv", cells_of(separator, ends=(400, 400, 400, n)))
    (hit,) = read_hits(path)
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-7)
    longer = path.read_text().splitlines()
    longer[n] += f"{separator}5"
    with pytest.raises(DataError, match=rf"line {n + 1}: 5 .*3"):
        inspect_file(put(tmp_path / "b.csv", "\n".join(longer) + "\n"))


def test_a_response_that_is_not_chosen_may_end_early_and_have_gaps(tmp_path: Path) -> None:
    text = cells_of(",", (7, 3, ""), ends=(400, 400, 400, 50)).replace("Temp", "Acc y (g)")
    path = put(tmp_path / "a.csv", text)
    assert complaint(path).endswith("2 responses: 1 Acc, 2 Acc y (give Description.response, for example 1)")
    assert read_hits(path, Description(response=1))[0].acceleration == pytest.approx(RESPONSE, abs=1e-7)
    assert "Acc y is empty in line 9" in complaint(path, response=2)


def test_a_force_that_is_not_used_may_have_gaps(tmp_path: Path) -> None:
    path = put(tmp_path / "a.csv", cells_of(",", (7, 1, ""), ends=(400, 20, 400, 400)))
    assert read_hits(path, Description(without_force=True))[0].acceleration == pytest.approx(RESPONSE, abs=1e-7)


def test_of_several_time_columns_that_of_another_channel_may_end_early(tmp_path: Path) -> None:
    lines = [f"{t},{f},{t},{a},{t if i < 100 else ''},{1 if i < 100 else ''}\n" for i, (t, f, a, _) in enumerate(HIT)]
    head = "Time (s),Force (N),Time 2 (s),Acc (g),Time 3 (s),Acc y (g)\n"
    path = put(tmp_path / "a.csv", head + "".join(lines))
    assert read_hits(path, Description(response=1))[0].force == pytest.approx(FORCE, abs=1e-7)
    assert read_hits(path, Description(response=2))[0].force == pytest.approx(FORCE[:100], abs=1e-7)


def test_a_row_that_ends_early_above_one_that_does_not_has_lost_a_number(tmp_path: Path) -> None:
    lines = cells_of(",").splitlines(keepends=True)
    lines[50] = "0.01,3,20\n"
    with pytest.raises(DataError, match=r"line 51: 3 .*4"):
        read_hits(put(tmp_path / "a.csv", "".join(lines)))


def test_of_columns_between_blanks_none_can_end_early(tmp_path: Path) -> None:
    lines = [
        "Time(s) Force(N) Acc(g) Temp\n",
        *(" ".join(row[: 4 if i < 300 else 3]) + "\n" for i, row in enumerate(HIT)),
    ]
    with pytest.raises(DataError, match=r"line 302: 3 .*4"):
        read_hits(put(tmp_path / "a.txt", "".join(lines)))


@pytest.mark.parametrize("n_short", [1, 7])
def test_of_a_few_rows_that_stop_early_each_may_have_lost_a_number(tmp_path: Path, n_short: int) -> None:
    lines = cells_of(",").splitlines(keepends=True)
    lines[-n_short:] = ["0.0995,3,20\n"] * n_short
    with pytest.raises(DataError, match=rf"line {402 - n_short}: 3 .*4"):
        read_hits(put(tmp_path / "a.csv", "".join(lines)))


@pytest.mark.parametrize("end", ["9.9e-2", "9.9e-2,1", "9.9e-2,1,", "9.9e-2,1,2", "9.9e-2,1,2,"])
def test_a_file_that_ends_within_its_last_row_is_cut_short(tmp_path: Path, end: str) -> None:
    with pytest.raises(DataError, match=r"line 402: \d numbers|truncated at line 402,"):
        read_hits(put(tmp_path / "a.csv", cells_of(",") + end))


def test_an_frf_is_cut_where_its_coherence_ends_and_rejected_for_a_gap(tmp_path: Path) -> None:
    lines = [row + "\n" for row in rows(F, H.real, H.imag, 0.9 + 0 * F, separator=",").split()]
    head = "Freq (Hz),Real (m/N),Imag (m/N),Coherence\n"
    ended = [row.replace(",0.9", ",") if i >= 40 else row for i, row in enumerate(lines)]
    found = inspect_file(put(tmp_path / "a.csv", head + "".join(ended))).require_valid()
    assert found.frf is not None
    assert found.frf.frequency.tolist() == F[:40].tolist()
    assert found.frf.receptance == pytest.approx(H[:40], rel=1e-9)
    (cut,) = (fact.value for fact in found.facts if fact.name == "rows" and fact.origin == "default")
    assert re.fullmatch("40 of 59, .*Coherence.*", cut)
    lines[9] = lines[9].replace(f"{H[9].imag:.12g}", "")
    assert "Imag is empty in line 11" in complaint(put(tmp_path / "b.csv", head + "".join(lines)))


def test_a_cell_may_be_empty_at_0_hz_alone(tmp_path: Path) -> None:
    text = "Freq (Hz),Real (m/N),Imag (m/N),Coherence\n{},,,\n" + rows(F, H.real, H.imag, 0.9 + 0 * F, separator=",")
    assert is_h(read_frf(put(tmp_path / "a.csv", text.format(0))))
    assert "Real is empty in line 2" in complaint(put(tmp_path / "b.csv", text.format(0.5)))


LVM = """LabVIEW Measurement
Separator\tTab
Decimal_Separator\t{sign}
X_Columns\tOne
***End_of_Header***
\t
Channels\t3
Samples\t400\t390\t400
Y_Unit_Label\tN\tm/s^2\tg
Delta_X\t0.00025\t0.00025\t0.00025
***End_of_Header***
X_Value\tForce\tAcc\tAcc y\tComment
"""


@pytest.mark.parametrize(("sign", "other"), [(",", "."), (".", ",")])
def test_lvm_with_gaps_and_thousands_apart(tmp_path: Path, sign: str, other: str) -> None:
    cells = [
        ["", numeral(1e4 * f, sign, other), numeral(1e4 * a, sign, other), "7"]
        for f, a in zip(FORCE, RESPONSE, strict=True)
    ]
    for i in range(390, 400):
        cells[i][2] = ""
    cells[20][3] = ""
    path = put(tmp_path / "a.lvm", LVM.format(sign=sign) + "".join("\t".join(row) + "\n" for row in cells))
    (hit,) = read_hits(path, Description(response=1))
    assert hit.force == pytest.approx(1e4 * FORCE[:390], abs=1e-5)
    assert hit.acceleration == pytest.approx(1e4 * RESPONSE[:390], abs=1e-5)
    assert "Acc y is empty in line 33" in complaint(path, response=2)


def test_a_cut_is_detected_to_where_its_sensor_ends(tmp_path: Path) -> None:
    lines = [f"{t},{a if i < 300 else ''},{3000 if i < 350 else ''}\n" for i, (t, _, a, _) in enumerate(HIT)]
    path = put(tmp_path / "a.csv", "Time (s),Acc (m/s^2),Speed (rpm)\n" + "".join(lines))
    sound = read_cut_recording(path)
    assert sound.acceleration == pytest.approx(RESPONSE[:300], abs=1e-7)
    path.write_text(path.read_text().replace(f"\n{HIT[9][0]},{HIT[9][2]},", f"\n{HIT[9][0]},,"))
    with pytest.raises(DataError, match="Acc is empty in line 11"):
        read_cut_recording(path)
