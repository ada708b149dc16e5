"""Text tables as analysers, loggers and spreadsheets write them: read as they are, or asked about in one message."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition import DataError, Description, Frf, look, read_frf, read_hits, read_recording

F = np.arange(1.0, 60.0)
H = 1e-6 / (1 + 0.1j * F)
TIME = np.arange(400) / 4000
FORCE = np.where(np.abs(TIME - 0.005) < 2e-3, 100 * np.cos(np.pi * (TIME - 0.005) / 4e-3) ** 2, 0.0)
RESPONSE = np.where(TIME > 0.005, np.exp(-200 * (TIME - 0.005)) * np.sin(2000 * TIME), 0.0)


def rows(*columns: np.ndarray, form: str = "%.12g", separator: str = "\t", end: str = "\n") -> str:
    return "".join(separator.join(form % value for value in row) + end for row in zip(*columns, strict=True))


def put(path: Path, text: str) -> Path:
    path.write_text(text, encoding="latin-1", newline="")
    return path


def complaint(path: Path, **said: object) -> str:
    return look(path, Description(**said)).complaint  # type: ignore[arg-type]


def is_h(frf: Frf) -> bool:
    return np.allclose(frf.receptance, H, rtol=1e-6, atol=0) and np.allclose(frf.frequency, F)


@pytest.mark.parametrize(
    ("form", "separator", "end", "heading"),
    [
        ("%.12e", "\t", "\t\r\n", "Freq\tHz\tReal\tm/N\tImag\tReal\t"),
        ("%.12e", " ", "\n", "\tFreq\tHz\tReal\tm/N\tImag\tm/N"),
        ("  %.12e", "\t", "\t\n", "Freq\tHz\tReal\tm/N\tImag\tReal"),
        (" %.12e ", " \t", " \t \n", "Freq\tHz\tReal\tm/N\tImag\tReal"),
        ("%.12e", "  ", " \n", "Freq Hz Real m/N Imag m/N"),
    ],
)
def test_a_heading_behind_the_first_row_however_rows_end(
    tmp_path: Path, form: str, separator: str, end: str, heading: str
) -> None:
    first, *others = rows(F, H.real, H.imag, form=form, separator=separator, end=end).splitlines(keepends=True)
    path = put(tmp_path / "tap.frf", first.rstrip("\r\n") + heading + "\n" + "".join(others))
    assert is_h(read_frf(path))


PREAMBLES = [
    "",
    "Analyser 7\nmeasured by me, on the mill\n\n",
    "Title;a;b;c;d;e\nDate;2024-05-01\nChannels;2\n" + "note;x\n" * 40,
    "Point\t5\nUnits: Ratio\n\nan odd line with, commas; and\ttabs\n",
]


@pytest.mark.parametrize(
    "below", ["=========\n", "---{0}---{0}---\n", "Begin of data:\nlines 59 from 1 to 59 Hz in all\n"]
)
@pytest.mark.parametrize("preamble", PREAMBLES)
@pytest.mark.parametrize("separator", ["\t", ";", ",", " "])
def test_other_lines_around_the_heading(tmp_path: Path, preamble: str, below: str, separator: str) -> None:
    heading = separator.join(["Freq[Hz]", "Real[m/N]", "Imag[m/N]"])
    text = f"{preamble}{heading}\n{below.format(separator)}{rows(F, H.real, H.imag, separator=separator)}"
    assert is_h(read_frf(put(tmp_path / "a.txt", text)))


def test_a_heading_may_have_other_separators_than_the_rows(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "Freq (Hz), Real (m/N), Imag (m/N)\n" + rows(F, H.real, H.imag))
    assert is_h(read_frf(path))
    path = put(tmp_path / "b.txt", "Freq (Hz)   Real (m/N)   Imag (m/N)\n" + rows(F, H.real, H.imag, separator=";"))
    assert is_h(read_frf(path))
    path = put(tmp_path / "c.txt", 'Freq (Hz),"Real, first (m/N)",Imag\n' + rows(F, H.real, H.imag, separator=","))
    assert is_h(read_frf(path))


@pytest.mark.parametrize("end", [",\n", ",,\n", " , \n"])
def test_separators_behind_the_last_column(tmp_path: Path, end: str) -> None:
    heading = "Freq (Hz),Real (m/N),Imag (m/N)"
    path = put(tmp_path / "a.csv", heading + end + rows(F, H.real, H.imag, separator=",", end=end))
    assert is_h(read_frf(path))
    path = put(tmp_path / "b.csv", heading + "\n" + rows(F, H.real, H.imag, separator=",", end=end))
    assert is_h(read_frf(path))


def test_headings_of_another_width_are_no_hindrance_where_columns_are_named(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "Freq\tReal\n" + rows(F, H.real, H.imag))
    assert "what its columns are (column 1, column 2, column 3)" in complaint(path)
    assert is_h(read_frf(path, Description(columns=("frequency", "real [m/N]", "imag"))))


def test_units_below_the_names_though_not_all_are_known(tmp_path: Path) -> None:
    head = "Zeit;Kraft;Beschl.;Temp\ns;N;g;Grad C\n"
    path = put(tmp_path / "a.csv", head + rows(TIME, FORCE, RESPONSE, TIME, separator=";"))
    (hit,) = read_hits(path)
    assert hit.acceleration == pytest.approx(9.80665 * RESPONSE, abs=1e-9)
    assert hit.sample_rate == pytest.approx(4000)
    for ranges in ("Range;500;50;100\n", ";500;50;100\n"):
        path = put(tmp_path / "b.csv", head + ranges + rows(TIME, FORCE, RESPONSE, TIME, separator=";"))
        assert read_hits(path)[0].force == pytest.approx(FORCE, abs=1e-9)


@pytest.mark.parametrize(
    "heading",
    [
        "# Freq (Hz)\tReal (m/N)\tImag (m/N)\n",
        "% Freq Real Imag\n% Hz m/N m/N\n",
        "# made by a script\n# lines: 59\n# Freq[Hz] Real[m/N] Imag[m/N]\n",
        "Freq\tHz\tReal\tm/N\tImag\tm/N\n",
    ],
)
def test_headings_that_are_comments_or_names_and_units_in_turn(tmp_path: Path, heading: str) -> None:
    assert is_h(read_frf(put(tmp_path / "a.txt", heading + rows(F, H.real, H.imag))))


def test_words_below_the_rows_are_told_and_a_broken_last_row_is_refused(tmp_path: Path) -> None:
    text = "Freq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag)
    found = look(put(tmp_path / "a.txt", f"{text}End of file\n")).checked()
    assert found.frf is not None
    assert is_h(found.frf)
    assert "below its rows stands 'End of file'" in [fact.value for fact in found.facts]
    for last in ("60\toverflow\tx\n", "nan\tnan\tnan\n", "x\t2\t3\n"):
        with pytest.raises(DataError, match=r"line 61|not finite|rising"):
            look(put(tmp_path / "a.txt", text + last)).checked()


def test_a_column_of_clock_times_and_empty_columns_are_left_out(tmp_path: Path) -> None:
    stamped = "".join(f"2024-05-01 12:00:{int(f) % 60:02d},{f},,{h.real},{h.imag}\n" for f, h in zip(F, H, strict=True))
    assert is_h(read_frf(put(tmp_path / "a.csv", "Clock,Freq (Hz),,Real (m/N),Imag (m/N)\n" + stamped)))
    assert is_h(
        read_frf(
            put(
                tmp_path / "b.txt",
                "\tFreq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag, form="\t%.12g", separator=""),
            )
        )
    )


def test_a_column_of_words_is_told(tmp_path: Path) -> None:
    lines = rows(F, H.real, H.imag).replace("\n", "\tok\n")
    found = look(put(tmp_path / "a.txt", "Freq (Hz)\tReal (m/N)\tImag (m/N)\tCoherence\n" + lines)).checked()
    assert "beside its columns stands 'ok' in the last row" in [fact.value for fact in found.facts]


def test_numbers_above_a_text_are_no_table(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "1 a\n2 b\n3 c\n" + "words alone\n" * 20 + "4 words\n")
    with pytest.raises(DataError, match=r"a\.txt: line 1: no rows of numbers begin here; pass over .* --skip"):
        look(path)


def test_a_line_at_0_hz_that_is_no_number_is_left_out(tmp_path: Path) -> None:
    text = "Freq (Hz)\tReal (m/N)\tImag (m/N)\tCoherence\n0\tnan\tnan\tnan\n" + rows(F, H.real, H.imag, 0.9 + 0 * F)
    frf = read_frf(put(tmp_path / "a.txt", text))
    assert is_h(frf)
    assert frf.coherence == pytest.approx(0.9)


def test_notes_to_the_right_in_a_few_rows(tmp_path: Path) -> None:
    lines = rows(TIME, FORCE, RESPONSE, separator=",").splitlines()
    lines[:3] = [f"{line},,{note}" for line, note in zip(lines, ("Range,500", "Filter,off", "x"), strict=False)]
    path = put(tmp_path / "a.csv", "ID,7\nTime,Force,Acc,,Notes\n[s],[N],[m/s2]\n" + "\n".join(lines) + "\n")
    (hit,) = read_hits(path)
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-9)
    lines[5] += ",7.5"
    put(path, "Time (s),Force (N),Acc (m/s2)\n" + "\n".join(lines) + "\n")
    with pytest.raises(DataError, match=r"a\.csv: line 7: 4 numbers where other rows have 3"):
        read_hits(path)


def test_a_broken_first_row_is_no_heading(tmp_path: Path) -> None:
    text = rows(F, H.real, H.imag, separator=",")
    path = put(tmp_path / "a.csv", "Freq (Hz),Real (m/N),Imag (m/N)\nx,1e-6,2e-7\n" + text)
    with pytest.raises(DataError, match=r"line 2: 'x,1e-6,2e-7' is no row of numbers; mend it, or .* --skip 2$"):
        read_recording(path)
    assert is_h(read_frf(path, Description(skip=2, columns=("frequency", "real [m/N]", "imag"))))


def test_lines_above_the_rows_are_passed_over(tmp_path: Path) -> None:
    heading = "Freq (Hz),Real (m/N),Imag (m/N)\n"
    path = put(tmp_path / "a.csv", "12,1\n5,2\n7,3\n1,2\n" + heading + rows(F, H.real, H.imag, separator=","))
    with pytest.raises(DataError):
        read_recording(path)
    assert is_h(read_frf(path, Description(skip=4)))
    npy = tmp_path / "a.npy"
    np.save(npy, H)
    with pytest.raises(DataError, match="--skip 4: a NumPy file has no lines to pass over; leave the option out"):
        look(npy, Description(skip=4))


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
    assert '--columns "frequency [Hz]=w,real=re,imag=im", or [rad/s]' in complaint(path)
    answer = ("frequency [rad/s]=w", "real=re", "imag=im")
    assert is_h(read_frf(path, Description(columns=answer, unit="m/N")))


def test_an_frf_without_its_frequencies_asks_for_their_spacing(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "".join(SPELLINGS["numpy"](h) + "\n" for h in H))
    said = complaint(path)
    assert "the unit of column 1 (--unit" in said
    assert "the frequencies of its lines (--spacing 0.5 --start 0 in Hz)" in said
    assert is_h(read_frf(path, Description(unit="m/N", spacing=1.0, start=1.0)))
    two = put(tmp_path / "b.txt", rows(H.real, H.imag))
    assert is_h(read_frf(two, Description(columns=("real [m/N]", "imag"), spacing=1.0, start=1.0)))
    for wrong in (0.0, -1.0, np.nan, np.inf):
        assert "give a spacing > 0 Hz" in complaint(path, unit="m/N", spacing=wrong)
    assert "give a spacing > 0 Hz and a start >= 0 Hz" in complaint(path, unit="m/N", spacing=1.0, start=-1.0)


def test_a_spacing_is_refused_where_the_file_has_an_axis(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "Freq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag))
    assert "--spacing, --start: the file holds its frequencies, Freq; leave them out" in complaint(path, spacing=1.0)
    hit = put(tmp_path / "b.txt", "time_s\tforce_N\tacc_g\n" + rows(TIME, FORCE, RESPONSE))
    assert "--spacing: the file holds signals over time; leave the option out" in complaint(hit, spacing=1.0)


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


def test_columns_that_are_not_all_named_or_called_the_same_are_refused(tmp_path: Path) -> None:
    text = rows(np.arange(59.0), F, H.real, H.imag)
    path = put(tmp_path / "a.txt", text)
    said = complaint(path, columns=("frequency", "real [m/N]", "imag"))
    assert "--columns names 3 of its 4 columns, which are column 1, column 2, column 3, column 4" in said
    assert '"-" for what is left out' in said
    twice = put(tmp_path / "b.txt", "No.\tx\tx\tx\n" + text)
    said = complaint(twice, columns=("frequency=x", "real [m/N]=3", "imag=4"))
    assert "3 columns are called 'x'; say which by its number, 2, 3, 4" in said
    assert is_h(read_frf(twice, Description(columns=("frequency [Hz]=2", "real [m/N]=3", "imag=4"))))


def test_a_column_is_named_once(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", rows(np.arange(59.0), F, H.real, H.imag))
    said = complaint(path, columns=("frequency [Hz]=2", "real [m/N]", "imag=4"))
    assert "--columns 'real [m/N]': column 2 is named twice; name each column once" in said


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0, 0.3125, 2.5])
def test_a_frequency_in_rad_per_s_is_asked_about_and_never_taken_as_hz(tmp_path: Path, step: float) -> None:
    frequency = step * np.arange(2000)
    h = 1 / (4e8 * (1 - (frequency / 150) ** 2 + 2j * 0.01 * frequency / 150))
    for name in ("w", "omega", "x", "frequency"):
        path = put(tmp_path / "a.csv", f"{name},re,im\n" + rows(2 * np.pi * frequency, h.real, h.imag, separator=","))
        assert f"the unit of {name}, Hz or rad/s" in complaint(
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
    assert (
        complaint(path)
        == 'it does not say: the sensitivity of the sensor, as its FRF is in V/N (--sensitivity "10.2 mV/g")'
    )
    assert is_h(read_frf(path, Description(sensitivity=("10.2 mV/g",))))
    assert "give that of the sensor" in complaint(path, sensitivity=("2.25 mV/N",))
    both = put(
        tmp_path / "b.csv", "Freq (Hz),Real,Imag\n" + rows(F, volts.real / 2.25e-3, volts.imag / 2.25e-3, separator=",")
    )
    for sensors in (("2.25 mV/N", "10.2 mV/g"), ("10.2 mV/g", "2.25 mV/N")):
        assert is_h(read_frf(both, Description(unit="V/V", sensitivity=sensors)))
    assert "the sensitivity of hammer and sensor" in complaint(both, unit="V/V")
    plain = put(tmp_path / "c.csv", "Freq (Hz),Real (g/N),Imag (g/N)\n" + text)
    assert "--sensitivity: its FRF is not in volts; leave it out" in complaint(plain, sensitivity=("10.2 mV/g",))
    mixed = put(tmp_path / "d.csv", "Freq (Hz),Real (V/N),Imag (mV/N)\n" + text)
    assert "they must be the same" in complaint(mixed, sensitivity=("10.2 mV/g",))


def test_the_heading_is_the_line_of_which_most_is_known(tmp_path: Path) -> None:
    near = "Name,of,the machine\nTime,of day,noon\n"
    for text in ("Freq (Hz),Real (m/N),Imag\n" + near, near + "Freq (Hz),Real (m/N),Imag\n"):
        assert is_h(read_frf(put(tmp_path / "a.csv", text + rows(F, H.real, H.imag, separator=","))))


def test_a_file_of_the_force_is_refused_beside_an_frf(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "Freq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag))
    force = put(tmp_path / "b.txt", rows(TIME, FORCE))
    assert "--force: the file holds an FRF; leave the option out" in complaint(path, force=force)


def test_two_files_with_headings_need_no_word(tmp_path: Path) -> None:
    force = put(tmp_path / "impact.txt", "time_s\tforce_N\n" + rows(TIME, FORCE))
    response = put(tmp_path / "accel.txt", "time_s\tacc_g\n" + rows(TIME, RESPONSE))
    (hit,) = read_hits(response, Description(force=force))
    assert hit.force == pytest.approx(FORCE, abs=1e-9)


def test_a_file_a_channel(tmp_path: Path) -> None:
    force = put(tmp_path / "impact.txt", rows(TIME, FORCE, end="\r\n"))
    response = put(tmp_path / "accel.txt", rows(TIME, RESPONSE, end="\r\n"))
    assert "--force FILE where the force stands in another" in complaint(response)
    columns = ("time [s]", "acceleration [m/s^2]", "time [s]", "force [N]")
    (hit,) = read_hits(response, Description(force=force, columns=columns))
    assert hit.force == pytest.approx(FORCE, abs=1e-9)
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-9)
    names = "column 1, column 2, column 1 of impact.txt, column 2 of impact.txt"
    assert names in complaint(response, force=force)
    for spoilt in (TIME + 0.1, 2 * TIME):
        put(force, rows(spoilt, FORCE))
        assert "its time axes differ" in complaint(response, force=force, columns=columns)
    put(force, rows(TIME[:-3], FORCE[:-3]))
    assert "its channels differ in length: column 2 of impact.txt [N] (397), column 2 [m/s^2] (400)" in complaint(
        response, force=force, columns=columns
    )
    with pytest.raises(FileNotFoundError, match="nowhere"):
        look(response, Description(force=tmp_path / "nowhere.txt"))


@pytest.mark.parametrize("form", ["%.2E", "%.3f", "%.4f"])
def test_a_time_that_is_printed_with_few_digits(tmp_path: Path, form: str) -> None:
    n = 4000
    time = np.arange(n) / 4000
    printed = np.array([float(form % value) for value in time])
    assert np.max(np.abs(printed * 4000 - np.arange(n))) > 0.1
    force, response = np.resize(FORCE, n) * (time < 0.1), np.resize(RESPONSE, n) * (time < 0.1)
    path = put(tmp_path / "a.txt", rows(printed, force, response))
    said = Description(columns=("time [s]", "force [N]", "acceleration [g]"))
    assert read_hits(path, said)[0].sample_rate == pytest.approx(4000, rel=3e-4)
    assert any("few digits" in fact.value for fact in look(path, said).facts)


@pytest.mark.parametrize("lost", [1, 3])
def test_a_lost_sample_is_no_want_of_digits(tmp_path: Path, lost: int) -> None:
    time = np.delete(np.arange(1000.0 + lost), np.arange(600, 600 + lost))  # whole milliseconds
    path = put(tmp_path / "a.txt", rows(time, np.resize(FORCE, 1000), np.resize(RESPONSE, 1000)))
    said = complaint(path, columns=("time [ms]", "force [N]", "acceleration [g]"))
    assert "its time steps are uneven" in said
    assert "give --rate" in said


SIGNAL_CALC = (
    "Units: Ratio\r\nRef Chan:Resp Chan\t0-Z:0-Z\r\nChannel Name\t : \r\nChannel Comment\t : \r\n\r\n"
    "Frequency\t Real\t Imaginary\r\n\r\nUnits:\r\nHz\t(m/s\xb2)(N)\t \r\n"
)


def test_text_of_signalcalc(tmp_path: Path) -> None:
    accelerance = -((2 * np.pi * F) ** 2) * H
    text = rows(F, accelerance.real, accelerance.imag, separator="\t      ", end="\r\n")
    path = put(tmp_path / "Hxy.txt", SIGNAL_CALC + text)
    assert not complaint(path)
    assert is_h(read_frf(path))
    product = put(tmp_path / "other.txt", SIGNAL_CALC.replace("Units: Ratio", "Units: Product") + text)
    assert "which is not known here as its unit" in complaint(product)


def pulse(header: dict[str, str], *blocks: str) -> str:
    """As PULSE exports it; the real ones have more keys, and empty lines of blanks among them."""
    keys = "".join(f"{key}:\t{value}\t \r\n \t \r\n" for key, value in header.items())
    head = "Z-index:\t \t{}\r\nDate:\t \t24/05/2019\r\nTime:\t \t18:23:06:464\r\nZ-axis:\t \t 0.0\r\n"
    return f"Header Size:\t 79\t \r\n{keys}" + "".join(head.format(i) + block for i, block in enumerate(blocks, 1))


HEADER = {
    "Decimal Symbol": ".",
    "Date Format": "dd/MM/yyyy",
    "Time Format": "HH:mm:ss:mmm",
    "Data Type": "Complex",
    "X-Axis size": "59",
    "X-Axis unit": "Hz",
    "AmplitudeUnit": "(m/s\xb2)/N",
    "Function": "Frequency Response H1",
    "Title": "Frequency Response H1(Acc,Hammer) - Input",
}
ACCELERANCE = -((2 * np.pi * F) ** 2) * H
BLOCK = rows(np.arange(1.0, 60.0), F, ACCELERANCE.real, ACCELERANCE.imag, separator="\t ", end="\r\n")


@pytest.mark.parametrize("sign", [".", ","])
def test_text_of_pulse(tmp_path: Path, sign: str) -> None:
    path = put(tmp_path / "a.txt", pulse(HEADER | {"Decimal Symbol": sign}, BLOCK.replace(".", sign)))
    found = look(path).checked()
    assert found.frf is not None
    assert is_h(found.frf)
    assert f"{found.created:%Y-%m-%d %H:%M:%S}" == "2019-05-24 18:23:06"
    volts = put(path, pulse(HEADER | {"AmplitudeUnit": "V/N"}, BLOCK))
    assert complaint(volts).startswith("it does not say: the sensitivity of the sensor")
    two = put(path, pulse(HEADER, BLOCK, BLOCK))
    assert "which of its 2 FRFs is meant" in complaint(two)
    assert is_h(read_frf(two, Description(response=2)))
    cut = put(path, pulse(HEADER, BLOCK[: BLOCK.rindex("\r\n59") + 2]))
    with pytest.raises(DataError, match=r"line \d+: 58 of 59 rows are there; the file is cut short"):
        look(cut)
    with pytest.raises(DataError, match="its header lacks 'x-axis size'"):
        look(put(path, pulse({key: HEADER[key] for key in ("Decimal Symbol", "Data Type")}, BLOCK)))


def test_another_function_of_pulse_is_named_and_no_frf(tmp_path: Path) -> None:
    header = HEADER | {"Data Type": "Real", "Function": "Autospectrum", "Title": "Autospectrum(Acc)"}
    path = put(tmp_path / "a.txt", pulse(header, rows(np.arange(1.0, 60.0), F, F)))
    assert "Autospectrum(Acc)" in complaint(path)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(st.lists(st.tuples(st.integers(0, 2500), st.integers(0, 255)), min_size=1, max_size=4), st.sampled_from([0, 1]))
def test_of_altered_bytes_nothing_else_than_a_message_comes(
    tmp_path: Path, changes: list[tuple[int, int]], which: int
) -> None:
    text = (SIGNAL_CALC + BLOCK, pulse(HEADER, BLOCK))[which]
    content = bytearray(text.encode("latin-1"))
    for place, byte in changes:
        content[place] = byte
    path = tmp_path / "a.txt"
    path.write_bytes(content)
    with contextlib.suppress(DataError):
        look(path)


LINES = ("Analyser 7", "Point;5;up", "a, b", "Date\t2024-05-01", "-----", "Channels 3", "Range: 500 N", "")
SEPARATORS = ("\t", ";", ",", " ", " \t ", "   ")


@st.composite
def layouts(draw: st.DrawFn) -> tuple[str, bool, bool]:
    """A table of frequency, real and imaginary part as somebody may write it; whether it says what they are, and
    whether an index stands before them."""
    separator = draw(st.sampled_from(SEPARATORS))
    comma = separator != "," and draw(st.booleans())
    form = draw(st.sampled_from(["%.9e", "%16.8e", "%.12g", "%+.9E"]))
    index, end = draw(st.booleans()), draw(st.sampled_from(["\n", "\r\n"]))
    behind = separator if draw(st.booleans()) and separator.strip(" ") else ""
    columns = [F, H.real, H.imag]
    text = rows(*([np.arange(59.0)] if index else []), *columns, form=form, separator=separator, end=behind + end)
    text = text.replace(".", ",") if comma else text
    above = end.join(draw(st.lists(st.sampled_from(LINES), max_size=4)))
    names, units = ["Freq", "Real", "Imag"], ["Hz", "m/N", "m/N"]
    style = draw(st.sampled_from(["none", "names [units]", "line of units"]))
    words = [f"{name}[{unit}]" for name, unit in zip(names, units, strict=True)] if style.startswith("names") else names
    lines = [["No", *words], ["-", *units]] if index else [words, units]
    heading = "".join(separator.join(line) + end for line in lines[: 1 + (style == "line of units")])
    return above + (end if above else "") + (heading if style != "none" else "") + text, style != "none", index


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(layouts())
def test_whatever_the_layout_two_commands_read_it(tmp_path: Path, layout: tuple[str, bool, bool]) -> None:
    text, is_said, with_index = layout
    path = put(tmp_path / "a.txt", text)
    found = look(path)
    assert bool(found.complaint) is not is_said
    columns = ("-",) * with_index + ("frequency [Hz]", "real [m/N]", "imag")
    found = found if is_said else look(path, Description(columns=columns))
    assert found.checked().frf is not None
    assert is_h(found.frf)  # type: ignore[arg-type]
