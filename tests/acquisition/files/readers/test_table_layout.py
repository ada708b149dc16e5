"""Text tables of analysers, loggers and spreadsheets: read, or one message that names all missing facts."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from written_tables import FORCE, RESPONSE, TIME, F, H, complaint, is_h, put, rows

from acquisition import DataError, Description, inspect_file, read_frf, read_hits, read_recording
from acquisition.files.readers.table_layout import begins_with_number


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
    assert "columns column 1, column 2, column 3 (give Description.columns" in complaint(path)
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


def test_words_below_the_rows_are_reported_and_a_broken_last_row_is_rejected(tmp_path: Path) -> None:
    text = "Freq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag)
    found = inspect_file(put(tmp_path / "a.txt", f"{text}End of file\n")).require_valid()
    assert found.frf is not None
    assert is_h(found.frf)
    assert "ignored 'End of file' below the rows" in [fact.value for fact in found.facts]
    for last in ("60\toverflow\tx\n", "nan\tnan\tnan\n", "x\t2\t3\n"):
        with pytest.raises(DataError, match=r"line 61|not finite|increasing"):
            inspect_file(put(tmp_path / "a.txt", text + last)).require_valid()


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


def test_a_column_of_words_is_reported(tmp_path: Path) -> None:
    lines = rows(F, H.real, H.imag).replace("\n", "\tok\n")
    found = inspect_file(
        put(tmp_path / "a.txt", "Freq (Hz)\tReal (m/N)\tImag (m/N)\tCoherence\n" + lines)
    ).require_valid()
    assert any("'ok'" in fact.value for fact in found.facts)


def test_numbers_above_a_text_are_no_table(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "1 a\n2 b\n3 c\n" + "words alone\n" * 20 + "4 words\n")
    with pytest.raises(DataError, match=r"a\.txt: line 1: .* Description\.skip"):
        inspect_file(path)


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
    with pytest.raises(DataError, match=r"a\.csv: line 7: 4 .*3"):
        read_hits(path)


def test_a_broken_first_row_is_no_heading(tmp_path: Path) -> None:
    text = rows(F, H.real, H.imag, separator=",")
    path = put(tmp_path / "a.csv", "Freq (Hz),Real (m/N),Imag (m/N)\nx,1e-6,2e-7\n" + text)
    with pytest.raises(DataError, match=r"line 2: 'x,1e-6,2e-7' .* Description\.skip 2\.$"):
        read_recording(path)
    assert is_h(read_frf(path, Description(skip=2, columns=("frequency", "real [m/N]", "imag"))))


def test_the_heading_is_the_line_of_which_most_is_known(tmp_path: Path) -> None:
    near = "Name,of,the machine\nTime,of day,noon\n"
    for text in ("Freq (Hz),Real (m/N),Imag\n" + near, near + "Freq (Hz),Real (m/N),Imag\n"):
        assert is_h(read_frf(put(tmp_path / "a.csv", text + rows(F, H.real, H.imag, separator=","))))


LINES = ("Analyser 7", "Point;5;up", "a, b", "Date\t2024-05-01", "-----", "Channels 3", "Range: 500 N", "")
SEPARATORS = ("\t", ";", ",", " ", " \t ", "   ")


@st.composite
def layouts(draw: st.DrawFn) -> tuple[str, bool, bool]:
    """Draw a table of frequency, real and imaginary part, whether it names them, and whether an index comes first."""
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
    found = inspect_file(path)
    assert bool(found.problems) is not is_said
    columns = ("-",) * with_index + ("frequency [Hz]", "real [m/N]", "imag")
    found = found if is_said else inspect_file(path, Description(columns=columns))
    assert found.require_valid().frf is not None
    assert is_h(found.frf)  # type: ignore[arg-type]


@pytest.mark.parametrize("line", ["9" * 20_000 + "i", "(" + "9" * 20_000 + "i", "1 " * 10_000 + "(i"])
def test_a_line_made_to_be_slow_is_not(line: str) -> None:
    begin = time.process_time()
    begins_with_number(line)
    assert time.process_time() - begin < 1.0
