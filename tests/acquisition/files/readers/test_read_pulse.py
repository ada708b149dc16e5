"""Two files a test, printed times, and the texts of two analysers."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from written_tables import FORCE, RESPONSE, TIME, F, H, complaint, is_h, put, rows

from acquisition import DataError, Description, inspect_file, read_frf, read_hits


def test_a_file_of_the_force_is_rejected_next_to_an_frf(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "Freq (Hz)\tReal (m/N)\tImag (m/N)\n" + rows(F, H.real, H.imag))
    force = put(tmp_path / "b.txt", rows(TIME, FORCE))
    assert "Description.force: " in complaint(path, force=force)


def test_two_files_with_headings_need_no_word(tmp_path: Path) -> None:
    force = put(tmp_path / "impact.txt", "time_s\tforce_N\n" + rows(TIME, FORCE))
    response = put(tmp_path / "accel.txt", "time_s\tacc_g\n" + rows(TIME, RESPONSE))
    (hit,) = read_hits(response, Description(force=force))
    assert hit.force == pytest.approx(FORCE, abs=1e-9)


def test_a_file_a_channel(tmp_path: Path) -> None:
    force = put(tmp_path / "impact.txt", rows(TIME, FORCE, end="\r\n"))
    response = put(tmp_path / "accel.txt", rows(TIME, RESPONSE, end="\r\n"))
    assert "Description.columns" in complaint(response)
    columns = ("time [s]", "acceleration [m/s^2]", "time [s]", "force [N]")
    (hit,) = read_hits(response, Description(force=force, columns=columns))
    assert hit.force == pytest.approx(FORCE, abs=1e-9)
    assert hit.acceleration == pytest.approx(RESPONSE, abs=1e-9)
    names = "column 1, column 2, column 1 of impact.txt, column 2 of impact.txt"
    assert names in complaint(response, force=force)
    for spoilt in (TIME + 0.1, 2 * TIME):
        put(force, rows(spoilt, FORCE))
        assert "time columns differ" in complaint(response, force=force, columns=columns)
    put(force, rows(TIME[:-3], FORCE[:-3]))
    assert "(column 2 of impact.txt [N] (397), column 2 [m/s^2] (400))" in complaint(
        response, force=force, columns=columns
    )
    with pytest.raises(FileNotFoundError, match="nowhere"):
        inspect_file(response, Description(force=tmp_path / "nowhere.txt"))


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
    assert any("few digits" in fact.value for fact in inspect_file(path, said).facts)


@pytest.mark.parametrize("lost", [1, 3])
def test_a_lost_sample_is_no_want_of_digits(tmp_path: Path, lost: int) -> None:
    time = np.delete(np.arange(1000.0 + lost), np.arange(600, 600 + lost))  # whole milliseconds
    path = put(tmp_path / "a.txt", rows(time, np.resize(FORCE, 1000), np.resize(RESPONSE, 1000)))
    said = complaint(path, columns=("time [ms]", "force [N]", "acceleration [g]"))
    assert "time steps are uneven" in said
    assert "give Description.rate" in said


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
    assert "Description.columns" in complaint(product)


def pulse(header: dict[str, str], *blocks: str) -> str:
    """Return text as exported by PULSE; real files have more keys, and blank lines among them."""
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
    found = inspect_file(path).require_valid()
    assert found.frf is not None
    assert is_h(found.frf)
    assert f"{found.created:%Y-%m-%d %H:%M:%S}" == "2019-05-24 18:23:06"
    volts = put(path, pulse(HEADER | {"AmplitudeUnit": "V/N"}, BLOCK))
    assert complaint(volts).startswith("missing sensitivity of the sensor")
    two = put(path, pulse(HEADER, BLOCK, BLOCK))
    assert "2 FRFs: " in complaint(two)
    assert is_h(read_frf(two, Description(response=2)))
    cut = put(path, pulse(HEADER, BLOCK[: BLOCK.rindex("\r\n59") + 2]))
    with pytest.raises(DataError, match=r"line \d+: .*58 of 59 rows"):
        inspect_file(cut)
    with pytest.raises(DataError, match="X-axis size 'many'"):
        inspect_file(put(path, pulse(HEADER | {"X-Axis size": "many"}, BLOCK)))
    with pytest.raises(DataError, match="no rows"):
        inspect_file(put(path, pulse(HEADER)))


@pytest.mark.parametrize("absent", [("X-Axis size",), ("X-Axis size", "Data Type"), ("X-Axis size", "Decimal Symbol")])
def test_text_of_pulse_with_an_incomplete_header(tmp_path: Path, absent: tuple[str, ...]) -> None:
    header = {key: value for key, value in HEADER.items() if key not in absent}
    path = put(tmp_path / "a.txt", pulse(header, BLOCK))
    found = inspect_file(path).require_valid()
    assert found.frf is not None
    assert is_h(found.frf)
    assert any("X-axis size" in fact.value for fact in found.facts if fact.name == "note")
    bare = {key: value for key, value in header.items() if key in ("Decimal Symbol", "Data Type")}
    unnamed = put(path, pulse(bare, BLOCK))
    assert "Description.columns" in complaint(unnamed)
    assert is_h(read_frf(unnamed, Description(columns=("frequency [Hz]", "frf [m/s^2/N]"))))
    short = BLOCK[: BLOCK.rindex("\r\n59") + 2]
    with pytest.raises(DataError, match="58 of 59 rows"):
        inspect_file(put(path, pulse(header, BLOCK, short)))
    with pytest.raises(DataError, match=r"line \d+"):
        inspect_file(put(path, pulse(header, BLOCK[: BLOCK.rindex("\t")])))


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "utf-8"])
def test_text_of_pulse_in_another_encoding(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(pulse(HEADER, BLOCK).encode(encoding))
    recording = inspect_file(path).require_valid()
    assert recording.title == "B&K PULSE text"
    assert recording.frf is not None
    assert is_h(recording.frf)


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
        inspect_file(path)
