"""Columns of a table as people name them, and numbers as they write them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from written_tables import FORCE, RESPONSE, TIME, F, H, complaint, is_h, put, rows

from acquisition import DataError, Description, inspect_file, read_frf, read_recording

pytestmark = pytest.mark.quick


def test_lines_above_the_rows_are_skipped(tmp_path: Path) -> None:
    heading = "Freq (Hz),Real (m/N),Imag (m/N)\n"
    path = put(tmp_path / "a.csv", "12,1\n5,2\n7,3\n1,2\n" + heading + rows(F, H.real, H.imag, separator=","))
    with pytest.raises(DataError):
        read_recording(path)
    assert is_h(read_frf(path, Description(skip=4)))
    npy = tmp_path / "a.npy"
    np.save(npy, H)
    with pytest.raises(DataError, match=r"Description\.skip 4: .*NumPy"):
        inspect_file(npy, Description(skip=4))


SPELLINGS: dict[str, Callable[[complex], str]] = {
    "numpy": lambda z: f"({z.real:.9e}{z.imag:+.9e}j)",
    "python": lambda z: f"{z.real:.9e}{z.imag:+.9e}j",
    "matlab": lambda z: f"{z.real:.9e}{z.imag:+.9e}i",
    "spaced": lambda z: f"{z.real:.9e} {'+' if z.imag >= 0 else '-'} {abs(z.imag):.9e}i",
    "fortran": lambda z: f"({z.real:.9e},{z.imag:.9e})",
    "c++": lambda z: f"( {z.real:.9e} , {z.imag:.9e} )",
}


@pytest.mark.parametrize("separator", ["\t", " ", ";", ","])
@pytest.mark.parametrize("spelling", SPELLINGS)
def test_complex_numbers_as_text(tmp_path: Path, spelling: str, separator: str) -> None:
    lines = "".join(f"{f:g}{separator}{SPELLINGS[spelling](h)}\n" for f, h in zip(F, H, strict=True))
    path = put(tmp_path / "a.txt", f"Freq (Hz){separator}H(m/N)\n{lines}")
    assert is_h(read_frf(path))
    assert is_h(read_frf(put(path, lines), Description(columns=("frequency", "frf [m/N]"))))


@pytest.mark.parametrize("separator", ["\t", ";"])
@pytest.mark.parametrize("spelling", ["numpy", "python", "matlab", "spaced"])
def test_complex_numbers_as_text_with_decimal_commas(tmp_path: Path, spelling: str, separator: str) -> None:
    lines = "".join(f"{f:g}{separator}{SPELLINGS[spelling](h)}\n" for f, h in zip(F, H, strict=True))
    path = put(tmp_path / "a.txt", f"Freq (Hz){separator}H(m/N)\n{lines.replace('.', ',')}")
    assert is_h(read_frf(path))


@pytest.mark.parametrize("heading", ["Freq,Re(H),Im(H)", "f_Hz,real(FRF1),imag(FRF1)", "f (Hz),Re [H(f)],Im [H(f)]"])
@pytest.mark.parametrize("unit", ["", " [m/N]", "(m/N)"])
def test_headings_that_name_the_frf_in_brackets(tmp_path: Path, heading: str, unit: str) -> None:
    first, real, imag = heading.split(",")
    text = f"{first},{real}{unit},{imag}{unit}\n" + rows(F, H.real, H.imag, separator=",")
    path = put(tmp_path / "a.csv", text)
    assert is_h(read_frf(path, Description(unit="" if unit else "m/N")))


def test_the_advice_for_an_axis_that_has_no_name_names_both_parts(tmp_path: Path) -> None:
    path = put(tmp_path / "a.csv", "w,re,im\n" + rows(2 * np.pi * F, H.real, H.imag, separator=","))
    assert 'Description.columns, for example "frequency [Hz]=w,real=re,imag=im"' in complaint(path)
    answer = ("frequency [rad/s]=w", "real=re", "imag=im")
    assert is_h(read_frf(path, Description(columns=answer, unit="m/N")))


def test_an_frf_without_its_frequencies_asks_for_their_spacing(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "".join(SPELLINGS["numpy"](h) + "\n" for h in H))
    said = complaint(path)
    assert "column 1 (give Description.unit" in said
    assert "(give Description.spacing, for example 0.5 Description.start 0 in Hz)" in said
    assert is_h(read_frf(path, Description(unit="m/N", spacing=1.0, start=1.0)))
    two = put(tmp_path / "b.txt", rows(H.real, H.imag))
    assert is_h(read_frf(two, Description(columns=("real [m/N]", "imag"), spacing=1.0, start=1.0)))
    for wrong in (0.0, -1.0, np.nan, np.inf):
        assert f"Description.spacing {wrong:g}," in complaint(path, unit="m/N", spacing=wrong)
    assert "Description.start -1" in complaint(path, unit="m/N", spacing=1.0, start=-1.0)


def test_a_spacing_is_rejected_where_the_file_has_an_axis(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "Freq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag))
    assert "Description.spacing and Description.start: the file has its own frequencies (Freq)" in complaint(
        path, spacing=1.0
    )
    hit = put(tmp_path / "b.txt", "time_s\tforce_N\tacc_g\n" + rows(TIME, FORCE, RESPONSE))
    assert "Description.spacing: " in complaint(hit, spacing=1.0)


@pytest.mark.parametrize(
    "columns",
    [
        ("-", "frequency", "real [m/N]", "imag"),
        ("frequency=2", "real [m/N]=3", "imag=4"),
        ("frequency=Lines", "real [m/N]=R", "imag=I"),
        ("frequency=Lines [Hz]", "real=R [m/N]", "imag=I (59)"),
        ("frequency=Hz", "real=m/N", "imag=I"),
    ],
)
def test_columns_by_order_number_heading_or_unit(tmp_path: Path, columns: tuple[str, ...]) -> None:
    heading = "No.\tLines [Hz]\tR [m/N]\tI\n"
    path = put(tmp_path / "a.txt", heading + rows(np.arange(59.0), F, H.real, H.imag))
    assert is_h(read_frf(path, Description(columns=columns)))


def test_columns_that_are_not_all_named_or_called_the_same_are_rejected(tmp_path: Path) -> None:
    text = rows(np.arange(59.0), F, H.real, H.imag)
    path = put(tmp_path / "a.txt", text)
    said = complaint(path, columns=("frequency", "real [m/N]", "imag"))
    assert re.search("Description.columns: 3 .*4 .*column 1, column 2, column 3, column 4", said)
    assert '"-"' in said
    twice = put(tmp_path / "b.txt", "No.\tx\tx\tx\n" + text)
    said = complaint(twice, columns=("frequency=x", "real [m/N]=3", "imag=4"))
    assert re.search("Description.columns: 3 .*'x'.*2, 3, 4", said)
    assert is_h(read_frf(twice, Description(columns=("frequency [Hz]=2", "real [m/N]=3", "imag=4"))))


def test_a_column_is_named_once(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", rows(np.arange(59.0), F, H.real, H.imag))
    said = complaint(path, columns=("frequency [Hz]=2", "real [m/N]", "imag=4"))
    assert "Description.columns 'real [m/N]': column column 2 is named twice" in said


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0, 0.3125, 2.5])
def test_a_frequency_in_rad_per_s_is_asked_about_and_never_taken_as_hz(tmp_path: Path, step: float) -> None:
    frequency = step * np.arange(2000)
    h = 1 / (4e8 * (1 - (frequency / 150) ** 2 + 2j * 0.01 * frequency / 150))
    for name in ("w", "omega", "x", "frequency"):
        path = put(tmp_path / "a.csv", f"{name},re,im\n" + rows(2 * np.pi * frequency, h.real, h.imag, separator=","))
        assert f"unit of column {name!r}, Hz or rad/s" in complaint(
            path, columns=(f"frequency={name}", "real=re", "imag=im"), unit="m/N"
        )
        said = Description(columns=(f"frequency [rad/s]={name}", "real [m/N]=re", "imag=im"))
        assert read_frf(path, said).frequency == pytest.approx(frequency)
    in_hz = put(tmp_path / "b.csv", "frequency,re,im\n" + rows(frequency, h.real, h.imag, separator=","))
    assert read_frf(in_hz, Description(unit="m/N")).frequency == pytest.approx(frequency)


def test_volts_over_newton_with_a_sensitivity(tmp_path: Path) -> None:
    accelerance = -((2 * np.pi * F) ** 2) * H / 9.80665  # g/N
    volts = accelerance * 0.0102
    text = rows(F, volts.real, volts.imag, separator=",")
    path = put(tmp_path / "a.csv", "Freq (Hz),Real (V/N),Imag (V/N)\n" + text)
    assert re.search(r'sensor, .* V/N \(give Description\.sensitivity, for example "10\.2 mV/g"\)$', complaint(path))
    assert is_h(read_frf(path, Description(sensitivity=("10.2 mV/g",))))
    assert "Description.sensitivity 2.25 mV/N: " in complaint(path, sensitivity=("2.25 mV/N",))
    both = put(
        tmp_path / "b.csv", "Freq (Hz),Real,Imag\n" + rows(F, volts.real / 2.25e-3, volts.imag / 2.25e-3, separator=",")
    )
    for sensors in (("2.25 mV/N", "10.2 mV/g"), ("10.2 mV/g", "2.25 mV/N")):
        assert is_h(read_frf(both, Description(unit="V/V", sensitivity=sensors)))
    assert "sensitivity of hammer and sensor" in complaint(both, unit="V/V")
    plain = put(tmp_path / "c.csv", "Freq (Hz),Real (g/N),Imag (g/N)\n" + text)
    assert "Description.sensitivity: " in complaint(plain, sensitivity=("10.2 mV/g",))
    mixed = put(tmp_path / "d.csv", "Freq (Hz),Real (V/N),Imag (mV/N)\n" + text)
    assert "'V/N'" in complaint(mixed, sensitivity=("10.2 mV/g",))


@pytest.mark.parametrize("heading", ["w", "w [rad/s]", "w [Hz]"])
def test_a_unit_may_follow_the_name_of_a_column(tmp_path: Path, heading: str) -> None:
    path = put(tmp_path / "a.txt", f"{heading}\tre\tim\n" + rows(2 * np.pi * F, H.real, H.imag))
    for column in ("frequency=w [rad/s]", "frequency [rad/s]=w [rad/s]", "frequency [rad/s]=w"):
        assert is_h(read_frf(path, Description(columns=(column, "real=re [m/N]", "imag=im"))))
    if heading != "w [rad/s]":  # else it is the heading of the column
        assert "Description.columns" in complaint(path, columns=("frequency [Hz]=w [rad/s]", "real=re", "imag=im"))
    assert "Description.columns" in complaint(path, columns=("frequency=v [rad/s]", "real [m/N]=re", "imag=im"))
