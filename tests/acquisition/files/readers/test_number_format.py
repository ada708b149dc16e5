"""Numbers with thousands apart, and text in UTF-16 without its mark."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from written_tables import FORCE, HIT, RESPONSE, TIME, F, H, complaint, is_h, numeral, put, rows

from acquisition import DataError, Description, read_frf, read_hits

THOUSANDS = {
    ".": [",", " ", "\u00a0", "\u2009", "\u202f", "'", "\u2019"],
    ",": [".", " ", "\u00a0", "\u2009", "\u202f"],
}


@st.composite
def grouped_tables(draw: st.DrawFn) -> tuple[str, np.ndarray, str]:
    """Draw a hit with separated thousands in some layout, its force, and the encoding of the text."""
    decimal = draw(st.sampled_from([".", ","]))
    thousands = draw(st.sampled_from(THOUSANDS[decimal]))
    separator = draw(st.sampled_from(["\t", ";", ","]))
    quote = '"' if (separator == "," and "," in (decimal, thousands)) or draw(st.booleans()) else ""
    force = FORCE * draw(st.floats(11, 1e5)) * draw(st.sampled_from([1, -1]))
    table = [[numeral(x, decimal, thousands) for x in row] for row in zip(TIME, force, RESPONSE, strict=True)]
    body = "".join(separator.join(f"{quote}{cell}{quote}" for cell in row) + "\n" for row in table)
    return f"Time (s){separator}Force (N){separator}Acc (g)\n{body}", force, draw(st.sampled_from(ENCODINGS))


ENCODINGS = ["utf-8", "utf-8-sig", "utf-16-le", "utf-16-be", "utf-16"]


@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(grouped_tables())
def test_thousands_apart_in_any_layout_are_read_as_they_were_written(
    tmp_path: Path, table: tuple[str, np.ndarray, str]
) -> None:
    text, force, encoding = table
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode(encoding))
    (hit,) = read_hits(path)
    assert hit.force == pytest.approx(force, abs=1e-6)
    assert hit.sample_rate == pytest.approx(4000)


@pytest.mark.parametrize(("decimal", "thousands"), [(".", ","), (",", ".")])
def test_thousands_apart_between_blanks(tmp_path: Path, decimal: str, thousands: str) -> None:
    cells = [
        " ".join(numeral(x, decimal, thousands) for x in row) for row in zip(TIME, 50 * FORCE, RESPONSE, strict=True)
    ]
    path = put(tmp_path / "a.txt", "Time(s) Force(N) Acc(g)\n" + "\n".join(cells) + "\n")
    assert read_hits(path)[0].force == pytest.approx(50 * FORCE, abs=1e-6)


def doubtful(decimal: str, force: str, *others: str) -> str:
    """Write a hit with ambiguous forces but for some; its time and acceleration have this decimal sign."""
    forces = [*others, *[force] * (len(HIT) - len(others))]
    lines = [f"{t};{cell};{a}".replace(".", decimal) for (t, _, a, _), cell in zip(HIT, ["@"] * len(HIT), strict=True)]
    return "Time (s);Force (N);Acc (g)\n" + "".join(
        line.replace("@", cell) + "\n" for line, cell in zip(lines, forces, strict=True)
    )


@pytest.mark.parametrize(
    ("decimal", "force", "message"),
    [
        (".", "1,234", r"Force .*'1,234' in line 2, .*1\.234 or 1234 "),
        (".", "-12,345", r"Force .*'-12,345' in line 2, .*-12\.345 or -12345 "),
        (",", "1.234", r"Force .*'1\.234' in line 2, .*1\.234 or 1234 "),
    ],
)
def test_a_number_that_may_be_another_is_rejected_where_it_is_used(
    tmp_path: Path, decimal: str, force: str, message: str
) -> None:
    path = put(tmp_path / "a.csv", doubtful(decimal, force))
    assert re.search(message, complaint(path))
    later = put(tmp_path / "b.csv", doubtful(decimal, force, "7"))
    assert re.search(message.replace("line 2", "line 3"), complaint(later))
    said = Description(columns=("time [s]", "-", "acceleration [g]"), without_force=True)
    assert read_hits(path, said)[0].acceleration == pytest.approx(9.80665 * RESPONSE, abs=1e-6)


@pytest.mark.parametrize(
    ("decimal", "force", "other", "value"),
    [
        (",", "1,234", "7", 1.234),
        (".", "1.234", "7", 1.234),
        (".", "1,234", "2,345.5", 1234.0),
        (".", "1,234", "2,345,678", 1234.0),
        (",", "1.234", "2.345,5", 1234.0),
        (".", "1,234", "0,5", 1.234),
        (",", "1,234.5", "7", 1234.5),
        (".", "1.234,5", "7", 1234.5),
    ],
)
def test_what_another_number_shows_is_not_uncertain(
    tmp_path: Path, decimal: str, force: str, other: str, value: float
) -> None:
    path = put(tmp_path / "a.csv", doubtful(decimal, force, other))
    assert read_hits(path)[0].force[1:] == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize(
    ("force", "said", "value"),
    [("1,234", "comma", 1.234), ("1,234", "point", 1234.0), ("1.234", "comma", 1234.0), ("1.234", "point", 1.234)],
)
def test_a_person_says_which_sign_is_the_decimal_one(tmp_path: Path, force: str, said: str, value: float) -> None:
    whole = "".join(f"{place};{force if place else 7};{place % 7}\n" for place in range(len(HIT)))
    path = put(tmp_path / "a.csv", "Time (ms);Force (N);Acc (g)\n" + whole)
    remedy = "choose Description.decimal comma or Description.decimal point"
    fault = rf"Force .*'1,234' in line 3, .*1\.234 or 1234 \({remedy}\)"
    assert re.search(fault, complaint(path)) if "," in force else complaint(path) == ""
    assert read_hits(path, Description(decimal=said))[0].force[1:] == pytest.approx(value, rel=1e-12)


def test_a_decimal_sign_that_is_none_or_of_no_text_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"Description\.decimal dot .*comma or point"):
        read_hits(put(tmp_path / "a.csv", doubtful(".", "1,234")), Description(decimal="dot"))
    np.save(tmp_path / "a.npy", np.ones((8, 2)))
    with pytest.raises(DataError, match=r"Description\.decimal comma: .*NumPy"):
        read_hits(tmp_path / "a.npy", Description(decimal="comma"))


@pytest.mark.parametrize(
    ("decimal", "force", "other", "message"),
    [
        (",", "1,234.5", "0,5", r"Force .*'1,234\.5' in line 3, "),
        (".", "0,5", "1,234,567", "Force .*'0,5' in line 3, "),
        (".", "1,234", "7", r"Force .*'1,234' in line 3, .*1\.234 or 1234 "),
    ],
)
def test_columns_that_contradict_themselves_or_each_other_are_rejected(
    tmp_path: Path, decimal: str, force: str, other: str, message: str
) -> None:
    text = doubtful(decimal, force, other).splitlines()
    beside = [";Temp;More", *(";0,5;1,234.5" for _ in HIT)]
    path = put(tmp_path / "a.csv", "".join(f"{a}{b}\n" for a, b in zip(text, beside, strict=True)))
    assert re.search(message, complaint(path))


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("heading", ["Freq (Hz)\tReal (m/N)\tImag (m/N)\n", "频率(Hz)\t实部(m/N)\t虚部(m/N)\n", ""])
def test_utf_16_without_its_mark(tmp_path: Path, encoding: str, heading: str) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes((heading + rows(F, H.real, H.imag)).encode(encoding))
    said = Description() if heading else Description(columns=("frequency [Hz]", "real [m/N]", "imag"))
    assert is_h(read_frf(path, said))
