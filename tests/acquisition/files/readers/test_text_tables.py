"""Names, units, levels, notes and stacked tables as written by software of several countries."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from written_tables import FORCE, RESPONSE, TIME, F, H, complaint, is_h, put, rows

from acquisition import DataError, Description, inspect_file, read_frf, read_hits

HIT = rows(TIME, FORCE, RESPONSE, form="%.9g", separator=",")
LEVEL, DEGREES = 20 * np.log10(np.abs(H)), np.degrees(np.angle(H))


def write(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_text(text, encoding=encoding, newline="")
    return path


@pytest.mark.parametrize(
    ("heading", "encoding"),
    [
        ("Fréquence (Hz);Partie réelle (m/N);Partie imaginaire (m/N)", "latin-1"),
        ("Frecuencia [Hz];Parte real [m/N];Parte imaginaria [m/N]", "utf-8"),
        ("频率(Hz);实部(m/N);虚部(m/N)", "utf-8-sig"),
        ("周波数[Hz];実部[m/N];虚部[m/N]", "utf-16"),
        ("f / Hz;Re(H) / (m/N);Im(H) / (m/N)", "utf-8"),
        ("f/Hz;Re/(m/N);Im/(m/N)", "utf-8"),
        ("Frequency in Hz;Real in m/N;Imag in m/N", "utf-8"),
        ('"Frequency, Hz";"Real, m/N";"Imag, m/N"', "utf-8"),
        ("Freq (Hz);H1 Real (m/N);H1 Imag (m/N)", "utf-8"),
        ("Freq (CPM);FRF_real (m/N);FRF_imag (m/N)", "utf-8"),
    ],
)
def test_names_and_units_as_several_countries_write_them(tmp_path: Path, heading: str, encoding: str) -> None:
    frequency = 60 * F if "CPM" in heading else F
    path = write(tmp_path / "a.csv", f"{heading}\n" + rows(frequency, H.real, H.imag, separator=";"), encoding)
    assert is_h(read_frf(path))


@pytest.mark.parametrize("names", ["Fréquence (Hz),Module (m/N),Phase (degrés)", "频率/Hz,幅值/(m/N),相位/度"])
def test_magnitude_and_phase_as_several_countries_write_them(tmp_path: Path, names: str) -> None:
    path = write(tmp_path / "a.csv", f"{names}\n" + rows(F, np.abs(H), DEGREES, separator=","))
    assert is_h(read_frf(path))


@pytest.mark.parametrize(
    "heading", ["t / s,F / N,a / (m/s²)", "t/s,F/N,acc_m/s^2", "Temps (s),Force (daN),Accélération (m·s⁻²)"]
)
def test_hits_as_several_countries_write_them(tmp_path: Path, heading: str) -> None:
    force = FORCE / 10 if "daN" in heading else FORCE
    path = write(tmp_path / "a.csv", f"{heading}\n" + rows(TIME, force, RESPONSE, separator=","))
    (hit,) = read_hits(path)
    assert hit.force == pytest.approx(FORCE, abs=1e-8)
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-8)


@pytest.mark.parametrize(
    ("unit", "reference"),
    [
        ("dB re 1 um/N", 1e-6),
        ("dB re 1E-6 m/N", 1e-6),
        ("dB ref. 1.000 mm/N", 1e-3),
        ("dB um/N", 1e-6),
        ("dB, nm/N", 1e-9),
    ],
)
def test_a_level_says_what_it_is_a_multiple_of(tmp_path: Path, unit: str, reference: float) -> None:
    level = LEVEL - 20 * np.log10(reference)
    text = f"Frequency (Hz)\tMagnitude ({unit})\tPhase (deg)\n" + rows(F, level, DEGREES)
    path = put(tmp_path / "a.txt", text)
    assert is_h(read_frf(path))
    assert "Description.unit m/N: " in complaint(path, unit="m/N")


@pytest.mark.parametrize("unit", ["dB", "dBMag", "dB (rms)", "dB re 1"])
def test_a_level_of_nothing_known_asks_for_its_unit(tmp_path: Path, unit: str) -> None:
    path = put(tmp_path / "a.txt", f"Frequency (Hz)\tMag [{unit}]\tPhase (deg)\n" + rows(F, LEVEL, DEGREES))
    assert "unit of Mag (give Description.unit" in complaint(path)
    assert is_h(read_frf(path, Description(unit="m/N")))


@pytest.mark.parametrize("name", ["Magnitude dB (m/N)", "dB (m/N)", "Mag_dB [m/N]", "FRF dB (m/N)", "Mag (dB) [m/N]"])
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_a_name_says_that_a_column_is_in_db(tmp_path: Path, name: str, unit: float) -> None:
    """Below 0 or above it: of m/N, or of nm/N."""
    level = LEVEL - 20 * np.log10(unit)
    heading = f"Freq (Hz),{name},Phase (deg)\n".replace("m/N", "m/N" if unit == 1 else "nm/N")
    assert np.all((level < 0) if unit == 1 else (level > 0))
    assert is_h(read_frf(put(tmp_path / "a.csv", heading + rows(F, level, DEGREES, separator=","))))


def test_a_magnitude_below_zero_is_no_magnitude_but_a_level(tmp_path: Path) -> None:
    text = "Freq (Hz),Magnitude (m/N),Phase (deg)\n" + rows(F, LEVEL, DEGREES, separator=",")
    path = put(tmp_path / "a.csv", text)
    assert 'Description.columns, for example "frequency,db,' in complaint(path)
    assert is_h(read_frf(path, Description(columns=("frequency", "db", "phase [deg]"))))


@pytest.mark.parametrize(
    ("heading", "columns", "unit"),
    [
        ("f\tAmplitude\tPhase\n", "frequency,db,phase [deg]", "m/N"),
        ("f\tdB\tPhase\n", "frequency,db,phase [deg]", "m/N"),
        ("f\tLevel\tAngle in deg\n", "frequency [Hz],db [m/N],phase [deg]", ""),
        ("", "frequency [Hz],db [m/N],phase [deg]", ""),
    ],
)
def test_a_level_and_a_phase_need_two_commands(tmp_path: Path, heading: str, columns: str, unit: str) -> None:
    """The first one names the columns and the unit that the second one needs."""
    path = put(tmp_path / "a.txt", heading + rows(F, LEVEL, DEGREES))
    asked = complaint(path)
    assert columns in asked
    assert ("Description.unit" in asked) == bool(unit)
    assert is_h(read_frf(path, Description(columns=tuple(columns.split(",")), unit=unit)))


def test_a_level_among_other_columns_is_named_by_its_heading(tmp_path: Path) -> None:
    text = "note\tPhase\tf\tAmplitude\tCoh\n" + rows(F, DEGREES, F, LEVEL, np.ones(F.size))
    path = put(tmp_path / "a.txt", text)
    columns = "phase [deg]=Phase,frequency=f,db=Amplitude,coherence=Coh"
    assert columns in complaint(path)
    frf = read_frf(path, Description(columns=tuple(columns.split(",")), unit="m/N"))
    assert is_h(frf)
    assert frf.coherence is not None
    radians = "f\tAmplitude\tPhase\n" + rows(F, LEVEL, np.radians(DEGREES))
    assert "phase [rad]" in complaint(put(path, radians))


def test_one_real_column_called_frf_is_asked_about(tmp_path: Path) -> None:
    path = put(tmp_path / "a.csv", "Frequency (Hz),FRF (m/N)\n" + rows(F, np.abs(H), separator=","))
    assert "columns Frequency [Hz], FRF [m/N] (give Description.columns" in complaint(path)


@pytest.mark.parametrize("label", ["Unit", "Units", "Einheit:", "単位"])
def test_a_line_of_units_may_begin_with_the_word_for_it(tmp_path: Path, label: str) -> None:
    above = f"No.;Time;Hammer;Sensor\nRange;1;200;500\n{label};s;N;cm/s2\n"
    numbered = rows(np.arange(TIME.size), TIME, FORCE, RESPONSE * 100, separator=";")
    (hit,) = read_hits(write(tmp_path / "a.csv", above + numbered))
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-8)


def test_notes_next_to_rows_do_not_make_names_and_units_alternate(tmp_path: Path) -> None:
    first, *others = HIT.splitlines()
    notes = f"CH No.,CH6,CH8,,,\nUnit,N,cm/s2,,,\n{first},,Mass,2.5\n" + "".join(f"{row},,,\n" for row in others)
    path = put(tmp_path / "a.csv", notes)
    assert "(CH No., CH6 [N], CH8 [cm/s2])" in complaint(path, columns=("time",))
    (hit,) = read_hits(path, Description(columns=("time [s]", "force", "acceleration")))
    assert hit.acceleration == pytest.approx(RESPONSE / 100, abs=1e-10)


def test_ranges_below_the_names_are_no_broken_row(tmp_path: Path) -> None:
    text = f"Time (s),Force (N),Acc (m/s^2)\nSensitivity,2.25,10.2\n{HIT}"
    assert len(read_hits(put(tmp_path / "a.csv", text))) == 1


@pytest.mark.parametrize("footer", ["\nEnd of data\nAverages: 5\n", "Averages,5,\n", "Date: 2026-11-25\n", "Infos\n"])
def test_notes_below_the_rows_may_hold_a_number(tmp_path: Path, footer: str) -> None:
    text = "Freq (Hz),Real (m/N),Imag (m/N)\n" + rows(F, H.real, H.imag, separator=",") + footer
    assert is_h(read_frf(put(tmp_path / "a.csv", text)))


def test_a_row_below_the_rows_that_is_none_is_rejected(tmp_path: Path) -> None:
    text = "Freq (Hz),Real (m/N),Imag (m/N)\n" + rows(F, H.real, H.imag, separator=",") + "sixty,1e-8,2e-8\n"
    with pytest.raises(DataError, match=r"Freq .*'sixty' in line 61"):
        read_frf(put(tmp_path / "a.csv", text))


def test_tables_beneath_each_other_are_as_many_frfs(tmp_path: Path) -> None:
    heading = "Frequency (Hz)\tReal (um/N)\tImag (um/N)\n"
    tables = (f"Point {i}\n\n{heading}" + rows(F, i * H.real * 1e6, i * H.imag * 1e6) for i in (3, 1, 2))
    path = put(tmp_path / "a.txt", "".join(tables))
    assert "3 FRFs: " in complaint(path)
    assert is_h(read_frf(path, Description(response=2)))


@pytest.mark.parametrize("label", ["Hit {}\n", "\n"])
def test_tables_over_time_beneath_each_other_are_as_many_hits(tmp_path: Path, label: str) -> None:
    tables = (label.format(i) + f"Time (s),Force (N),Acc (m/s^2)\n{HIT}" for i in range(3))
    hits = read_hits(put(tmp_path / "a.csv", "".join(tables)))
    assert len(hits) == 3
    assert all(np.allclose(hit.acceleration, RESPONSE, atol=1e-8) for hit in hits)


@pytest.mark.parametrize("missing", ["#N/A", "n/a", "1.#QNAN", "-1.#IND00"])
def test_the_line_at_0_hz_may_be_missing_in_words(tmp_path: Path, missing: str) -> None:
    text = f"Freq (Hz),Real (m/N),Imag (m/N)\n0,{missing},{missing}\n" + rows(F, H.real, H.imag, separator=",")
    path = put(tmp_path / "a.csv", text)
    assert is_h(read_frf(path))
    path.write_text(text.replace("\n30,", f"\n30,{missing},0\n#"))
    assert re.search(f"Real .*'{missing}' in line 32", complaint(path))


def test_numbers_in_quotes_may_have_a_decimal_comma(tmp_path: Path) -> None:
    numbers = rows(F, H.real, H.imag, form="%.12e", separator=";").replace(".", ",")
    quoted = "".join(f'"{line}"\n'.replace(";", '","') for line in numbers.splitlines())
    assert is_h(read_frf(put(tmp_path / "a.csv", '"Freq (Hz)","Real (m/N)","Imag (m/N)"\n' + quoted)))


def test_rows_may_stand_in_quotes_as_a_whole(tmp_path: Path) -> None:
    quoted = "".join(f'"{line}"\n' for line in rows(F, H.real, H.imag, separator=",").splitlines())
    assert is_h(read_frf(put(tmp_path / "a.csv", '"Freq (Hz),""Real (m/N)"",""Imag (m/N)"""\n' + quoted)))


LVM = """LabVIEW Measurement
Writer_Version,2
Separator,Comma
Decimal_Separator,.
Multi_Headings,No
X_Columns,No
Date,2026/05/01
Time,09:30:00.5
***End_of_Header***,
,
Channels,2,,
Samples,400,390,
Y_Unit_Label,N,m/s^2,
Delta_X,0.00025,0.00025,
***End_of_Header***,,,
,hammer,sensor
"""


def test_lvm_names_its_separator_behind_that(tmp_path: Path) -> None:
    text = LVM.replace("390", "400") + "".join(f",{f:.9g},{a:.9g}\n" for f, a in zip(FORCE, RESPONSE, strict=True))
    (hit,) = read_hits(put(tmp_path / "a.lvm", text))
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-8)
    assert f"{inspect_file(tmp_path / 'a.lvm').created:%Y-%m-%d %H:%M:%S}" == "2026-05-01 09:30:00"


def test_lvm_whose_channels_are_of_several_lengths_is_cut_to_the_shortest(tmp_path: Path) -> None:
    cells = [f"{a:.9g}" for a in RESPONSE[:390]] + [""] * 10
    values = [f",{f:.9g},{cell}\n" for f, cell in zip(FORCE, cells, strict=True)]
    path = put(tmp_path / "a.lvm", LVM + "".join(values))
    found = inspect_file(path).require_valid()
    (cut,) = (fact.value for fact in found.facts if fact.name == "rows" and fact.origin == "default")
    assert re.fullmatch("390 of 400, .*sensor.*", cut)
    assert found.hits[0].force == pytest.approx(FORCE[:390], abs=1e-7)
    path.write_text(LVM.replace("390", "391") + "".join(values))
    with pytest.raises(DataError, match="390 of 391 samples"):
        inspect_file(path)
