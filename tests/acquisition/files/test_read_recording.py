"""Files of other programs: LVM and text tables, real ones and every fault that people make in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition import DataError, Description, HitFlags, check_hit, inspect_file, read_frf, read_hits, read_recording

pytestmark = pytest.mark.quick

N = 2000
RATE = 5000.0
TIME = np.arange(N) / RATE
FORCE = np.where(np.abs(TIME - 0.05) < 1e-3, 100 * np.cos(np.pi * (TIME - 0.05) / 2e-3) ** 2, 0.0)
ACCELERATION = np.where(TIME > 0.05, 50 * np.exp(-60 * (TIME - 0.05)) * np.sin(2 * np.pi * 300 * TIME), 0.0)


def table(path: Path, heading: str, *columns: np.ndarray, separator: str = ",", comma: bool = False) -> Path:
    rows = [separator.join(f"{value:.8g}" for value in row) for row in zip(*columns, strict=True)]
    text = "\n".join([heading, *(row.replace(".", ",") if comma else row for row in rows)])
    path.write_text(text, encoding="utf-8")
    return path


def test_real_lvm_with_decimal_comma_is_read_in_si(beam: Path) -> None:
    (hit,) = read_hits(beam)
    assert hit.force.size == 50030
    assert hit.sample_rate == pytest.approx(50000.0)
    assert np.max(hit.force) == pytest.approx(195.605522)
    assert hit.acceleration[0] == pytest.approx(-0.007387 * 9.80665)
    assert check_hit(hit) == HitFlags.OK
    assert f"{inspect_file(beam).created:%Y-%m-%d %H:%M:%S}" == "2018-12-17 10:18:21"


def test_real_cnc_table_is_rejected_with_all_its_faults(cnc_csv: Path) -> None:
    with pytest.raises(DataError) as caught:
        read_recording(cnc_csv)
    message = str(caught.value)
    assert "no force channel" in message
    assert "uneven" in message
    assert "column accel_y has the unit g" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("heading", "separator", "comma", "unit"),
    [
        ("time_s,force_N,acceleration_m_s2", ",", False, 1.0),
        ("Time (s);Force [N];Acc [m/s^2]", ";", True, 1.0),
        ("time [s]\tforce [N]\tacc [g]", "\t", True, 9.80665),
        ("t_s force_N acc_g", " ", False, 9.80665),
    ],
)
def test_tables_with_any_separator_and_decimal_sign(
    tmp_path: Path, heading: str, separator: str, comma: bool, unit: float
) -> None:
    path = table(tmp_path / "hit.csv", heading, TIME, FORCE, ACCELERATION / unit, separator=separator, comma=comma)
    (hit,) = read_hits(path)
    assert hit.sample_rate == pytest.approx(RATE)
    assert hit.force == pytest.approx(FORCE, abs=1e-6)
    assert hit.acceleration == pytest.approx(ACCELERATION, abs=1e-5)


def test_columns_are_distinguished_by_their_units_not_their_order(tmp_path: Path) -> None:
    path = table(tmp_path / "hit.csv", "time_s,acc_g,force_N", TIME, ACCELERATION / 9.80665, FORCE)
    assert np.max(read_hits(path)[0].force) == pytest.approx(np.max(FORCE))


def test_the_unit_of_time_is_read_and_never_guessed(tmp_path: Path) -> None:
    in_ms = table(tmp_path / "ms.csv", "time_ms,force_N,acc_g", TIME * 1e3, FORCE, ACCELERATION)
    assert read_hits(in_ms)[0].sample_rate == pytest.approx(RATE)
    with pytest.raises(DataError, match=r"Description.rate"):
        read_hits(table(tmp_path / "none.csv", "time,force_N,acc_g", TIME, FORCE, ACCELERATION))
    in_khz = table(tmp_path / "frf.csv", "Freq (kHz),Real (m/N),Imag", TIME + 1, FORCE, FORCE)
    assert read_frf(in_khz).frequency == pytest.approx(1e3 * (TIME + 1))
    with pytest.raises(DataError, match=r"'ms' .*Hz, kHz, rad/s"):
        read_frf(table(tmp_path / "ms.csv", "Freq (ms),Real (m/N),Imag", TIME + 1, FORCE, FORCE))


def test_a_computed_hit_that_rests_at_exactly_zero_is_good(tmp_path: Path) -> None:
    path = table(tmp_path / "hit.csv", "time_s,force_N,acc_m_s2", TIME, FORCE, ACCELERATION)
    assert check_hit(read_hits(path)[0]) == HitFlags.OK


def test_swapped_columns_are_rejected(tmp_path: Path) -> None:
    path = table(tmp_path / "hit.csv", "time_s,force_N,acc_m_s2", TIME, ACCELERATION, FORCE)
    with pytest.raises(DataError, match="swapped channels"):
        read_frf(path)


def test_an_frf_table_without_a_unit_is_asked_for_it(tmp_path: Path) -> None:
    frequency = np.arange(1.0, 50.0)
    path = table(tmp_path / "frf.txt", "Freq Real Imag", frequency, 1e-6 / frequency, -2e-6 / frequency, separator=" ")
    with pytest.raises(DataError, match=r"unit of Real \(give Description.unit, for example m/N, um/N or g/N\)$"):
        read_frf(path)
    frf = read_frf(path, Description(unit="m/N"))
    assert frf.receptance == pytest.approx((1e-6 - 2e-6j) / frequency)
    with pytest.raises(DataError, match=r"\.txt: .*FRF"):
        read_hits(path, Description(unit="m/N"))


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="latin-1")
    return path


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("time_s,force_N,acc_g\n", "1 lines"),
        (
            "time_s,force_N,acc_g\n0,1,x\n",
            "acc has 'x' in line 2, .*acc .*Description.columns",
        ),
        ("time_s,force_N,acc_g\n0,1,2\n0.1,3\n0.2,1,2\n", "line 3: 2 .*3"),
        ("time_s,force_N,acc_furlong\n" + "".join(f"{i},1,2\n" for i in range(9)), "acc_furlong"),
        ("time_s,force_N,acc_g\n0,1,2\n1,2,3\n", "2 samples .*8"),
        ("Freq Real(m/N) Imag\n1 2 nan\n2 3 4\n", "Imag has 'nan' in line 2"),
        (
            "\x00\x01\x02garbage",
            r"tap file of lobewatch \(\.h5\), univ",
        ),
    ],
)
def test_broken_tables_are_rejected_with_file_and_place(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path / "broken.csv", text)
    with pytest.raises(DataError, match=message) as caught:
        read_recording(path)
    assert "broken.csv" in str(caught.value)


def test_nan_in_a_hit_is_rejected_with_the_file(tmp_path: Path) -> None:
    broken = FORCE.copy()
    broken[77] = np.nan
    path = table(tmp_path / "nan.csv", "time_s,force_N,acc_g", TIME, broken, ACCELERATION)
    with pytest.raises(DataError, match=r"nan\.csv.*force has 'nan' in line 79"):
        read_hits(path)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "utf-8"])
def test_an_lvm_that_was_saved_in_another_encoding_is_the_same(beam: Path, tmp_path: Path, encoding: str) -> None:
    again = tmp_path / "again.lvm"
    again.write_bytes(beam.read_text("latin-1").encode(encoding))
    (first,), (second,) = read_hits(beam), read_hits(again)
    np.testing.assert_array_equal(first.acceleration, second.acceleration)
    np.testing.assert_array_equal(first.force, second.force)


def test_a_truncated_lvm_is_rejected(beam: Path, tmp_path: Path) -> None:
    lines = beam.read_text(encoding="latin-1").splitlines()
    with pytest.raises(DataError, match="9977 of 50030 samples"):
        read_hits(write(tmp_path / "cut.lvm", "\n".join(lines[:10000])))
    with pytest.raises(DataError, match="1 of at least 2 header ends"):
        read_hits(write(tmp_path / "head.lvm", "\n".join(lines[:15])))
    with pytest.raises(DataError, match=r"line 13: .*Delta_X"):
        read_hits(write(tmp_path / "bad.lvm", "\n".join(line.replace("Delta_X", "Delta") for line in lines)))
    garbled = [*lines[:5000], "\tabc\t1,0", *lines[5001:]]
    with pytest.raises(DataError, match="'abc' in line 5001"):
        read_hits(write(tmp_path / "garbled.lvm", "\n".join(garbled)))


def test_an_lvm_in_an_unknown_unit_or_without_force_is_rejected(beam: Path, tmp_path: Path) -> None:
    text = beam.read_text(encoding="latin-1")
    with pytest.raises(DataError, match="'Pascal' of Force"):
        read_hits(write(tmp_path / "a.lvm", text.replace("Newtons", "Pascal")))
    with pytest.raises(DataError, match="no force channel among"):
        read_hits(write(tmp_path / "b.lvm", text.replace("Newtons", "g").replace("Force", "Top")))


def test_a_file_that_does_not_tell_its_time_says_none(tmp_path: Path) -> None:
    path = table(tmp_path / "hit.csv", "time_s,force_N,acc_g", TIME, FORCE, ACCELERATION)
    assert inspect_file(path).created is None


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_frf(tmp_path / "nowhere.lvm")
