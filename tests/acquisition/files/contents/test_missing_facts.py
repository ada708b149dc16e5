"""Missing facts of a file: requested in one message by option name, never guessed."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition import DataError, Description, Frf, inspect_file, read_frf, read_hits, read_recording

F = np.arange(1.0, 60.0)
H = 1e-6 / (1 + 0.1j * F)
RATE = 51200.0
Read = Callable[..., Frf]


def rows(*columns: np.ndarray, form: str = "%.9g", separator: str = "\t") -> str:
    return "".join(separator.join(form % value for value in row) + "\n" for row in zip(*columns, strict=True))


def put(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def complaint(path: Path, **said: object) -> str:
    return inspect_file(path, Description(**said)).problems  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("unit", "to_unit"),
    [
        ("m/N", lambda h, _: h),
        ("um/N", lambda h, _: 1e6 * h),
        ("m/s/N", lambda h, w: 1j * w * h),
        ("m/s^2/N", lambda h, w: -(w**2) * h),
        ("g/N", lambda h, w: -(w**2) * h / 9.80665),
        ("in/s^2/lbf", lambda h, w: -(w**2) * h / 0.0254 * 4.4482216152605),
    ],
)
@pytest.mark.parametrize("by_option", [False, True])
def test_headings_and_options_in_any_unit_give_the_same_receptance(
    tmp_path: Path, unit: str, to_unit: Callable[..., np.ndarray], by_option: bool
) -> None:
    values = to_unit(H, 2 * np.pi * F)
    heading = "Freq\tReal\tImag\n" if by_option else f"Freq (Hz)\tReal ({unit})\tImag ({unit})\n"
    path = put(tmp_path / "frf.txt", heading + rows(F, values.real, values.imag))
    frf = read_frf(path, Description(unit=unit if by_option else ""))
    assert frf.receptance == pytest.approx(H, rel=1e-7)
    origins = {fact.name: fact.origin for fact in inspect_file(path, Description(unit=unit if by_option else "")).facts}
    assert origins["unit"] == ("option" if by_option else "file")
    assert origins["averages"] == "default"


def test_all_that_is_missing_is_reported_in_one_message(tmp_path: Path) -> None:
    path = put(tmp_path / "frf.txt", rows(F, H.real, H.imag))
    with pytest.raises(DataError, match=r'Description.columns "frequency \[Hz\],real \[m/N\],imag"'):
        read_recording(path)
    said = complaint(path, columns=("frequency", "real", "imag"))
    assert "give Description.unit, for example m/N" in said
    assert complaint(path, columns=("frequency", "real", "imag"), unit="g").endswith(
        "(give Description.force_unit, for example N, or Description.unit g/N)"
    )
    assert not complaint(path, columns=("frequency [Hz]", "real [um/N]", "imag"))
    hit = put(tmp_path / "hit.csv", "time\tforce\tacc\n" + rows(F, F, F))
    said = complaint(hit)
    assert [option in said for option in ("Description.rate", "Description.unit", "Description.force_unit")] == [
        True
    ] * 3


def test_magnitude_and_phase_and_decibel(tmp_path: Path) -> None:
    size, phase = np.abs(H), np.angle(H)
    plain = put(
        tmp_path / "a.csv", "f (Hz),Magnitude (m/N),Phase (deg)\n" + rows(F, size, np.degrees(phase), separator=",")
    )
    assert read_frf(plain).receptance == pytest.approx(H, rel=1e-6)
    level = 20 * np.log10(size / 1e-6)
    in_db = put(tmp_path / "b.csv", "f (Hz);Mag (dB re 1 um/N);Phase (rad)\n" + rows(F, level, phase, separator=";"))
    assert read_frf(in_db).receptance == pytest.approx(H, rel=1e-6)
    assert re.search("Description.unit m/N: .*1 um/N", complaint(in_db, unit="m/N"))
    path = put(tmp_path / "c.csv", "f (Hz);Mag (dB);Phase (rad)\n" + rows(F, level, phase, separator=";"))
    assert "unit of Mag (give Description.unit" in complaint(path)
    assert read_frf(path, Description(unit="um/N")).receptance == pytest.approx(H, rel=1e-6)
    no_phase = put(tmp_path / "d.csv", "f (Hz);Mag (dB);Phase\n" + rows(F, level, phase, separator=";"))
    assert "phase (give Description.columns" in complaint(no_phase, unit="um/N")


def test_options_that_the_file_contradicts_are_rejected(tmp_path: Path) -> None:
    path = put(tmp_path / "frf.txt", "Freq (Hz)\tReal (um/N)\tImag (um/N)\n" + rows(F, H.real, H.imag))
    assert re.search("Description.unit m/N: .*um/N", complaint(path, unit="m/N"))
    assert not complaint(path, unit="µm/N")
    assert "Description.quantity acceleration" in complaint(path, quantity="acceleration")
    assert "Description.rate: " in complaint(path, rate=100.0)
    assert "Description.averages 0" in complaint(path, averages=0)
    assert re.search("Description.response 2: .* 1 FRFs", complaint(path, response=2))
    assert "Description.columns 'nonsense': " in complaint(path, columns=("nonsense", "real", "imag"))
    assert "no column 4" in complaint(path, columns=("frequency", "-", "real", "imag"))


def test_the_heading_of_an_frf_file_stands_behind_its_first_row(tmp_path: Path) -> None:
    numbers = rows(F, H.real, H.imag, form="%.6e").splitlines()
    numbers[0] += "\tFreq\tHz\tReal\tm/N\tImag\tReal"
    path = put(tmp_path / "tap.frf", "\n".join(numbers))
    assert read_frf(path).receptance == pytest.approx(H, rel=1e-5)
    numbers[0] = numbers[0].replace("m/N", "um/N")
    assert read_frf(put(path, "\n".join(numbers))).receptance == pytest.approx(H * 1e-6, rel=1e-5)


def test_several_responses_are_asked_for_by_number(tmp_path: Path) -> None:
    heading = "Freq (Hz),Real (m/N),Imag,Real (m/N),Imag\n"
    path = put(tmp_path / "two.csv", heading + rows(F, H.real, H.imag, 2 * H.real, 2 * H.imag, separator=","))
    assert "2 FRFs" in complaint(path)
    assert read_frf(path, Description(response=2)).receptance == pytest.approx(2 * H, rel=1e-6)


@pytest.mark.parametrize("comma", [True, False])
@pytest.mark.parametrize("separator", ["\t", ";", " "])
def test_tables_without_a_heading(tmp_path: Path, separator: str, comma: bool) -> None:
    text = rows(F, H.real, H.imag, form="%.9e", separator=separator)
    path = put(tmp_path / "Messung Fräser 1.txt", text.replace(".", ",") if comma else text)
    frf = read_frf(path, Description(columns=("frequency", "real", "imag"), unit="m/N", averages=3))
    assert frf.receptance == pytest.approx(H, rel=1e-8)
    assert frf.n_averages == 3


def hit_signals(n: int = 20000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = np.arange(n) / RATE
    force = np.where(np.abs(time - 0.01) < 5e-4, 100 * np.cos(np.pi * (time - 0.01) / 1e-3) ** 2, 0.0)
    return time, force, np.where(time > 0.01, np.exp(-40 * (time - 0.01)) * np.sin(6000 * time), 0.0)


@pytest.mark.parametrize("form", ["%.7f", "float32"])
def test_a_time_axis_is_evaluated_as_a_whole(tmp_path: Path, form: str) -> None:
    time, force, response = hit_signals()
    printed = [float(np.float32(value)) for value in time] if form == "float32" else [float(form % t) for t in time]
    steps = np.diff(printed) * RATE
    assert np.max(np.abs(steps - 1)) > 5e-4
    path = put(tmp_path / "hit.txt", rows(np.array(printed), force, response, form="%.12g"))
    said = Description(columns=("time [s]", "force [N]", "acceleration [m/s^2]"))
    assert read_hits(path, said)[0].sample_rate == pytest.approx(RATE, rel=1e-5)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda t: np.delete(np.append(t, t[-1] + t[1]), t.size // 2),
        lambda t: np.delete(np.append(t, t[-1] + t[1]), -3),
        lambda t: np.sort(np.append(t[:-1], t[50])),
        lambda t: np.concatenate([t[:50], t[60:70], t[50:60], t[70:]]),
        lambda t: t[::-1],
        lambda t: np.where(t == t[9], np.nan, t),
        lambda t: t + 1e-3 * t[-1] * (t / t[-1]) ** 2,
    ],
    ids=["lost", "lost at the end", "twice", "not in order", "backwards", "nan", "drifts"],
)
def test_a_time_axis_that_is_not_even_is_rejected(tmp_path: Path, spoil: Callable[..., np.ndarray]) -> None:
    time, force, response = hit_signals(2000)
    path = put(tmp_path / "hit.txt", "time_s\tforce_N\tacc_g\n" + rows(spoil(time), force, response, form="%.12g"))
    with pytest.raises(DataError, match=r"uneven|not increase|time .*'nan' in line 11,"):
        read_hits(path)


def test_units_below_the_names_and_lines_above_them(tmp_path: Path) -> None:
    time, force, response = hit_signals(500)
    text = rows(time, force, response, separator=";").replace(".", ",")
    path = put(tmp_path / "hit.csv", f"Analyser 7\nmeasured by;me\nZeit;Kraft;Beschleunigung\ns;N;g\n{text}")
    assert read_hits(path)[0].acceleration == pytest.approx(response * 9.80665, abs=1e-6)
    assert not inspect_file(path).problems


def test_text_of_two_bytes_a_character(tmp_path: Path) -> None:
    path = tmp_path / "frf.txt"
    path.write_bytes(("Freq (Hz)\tReal (µm/N)\tImag (µm/N)\n" + rows(F, H.real * 1e6, H.imag * 1e6)).encode("utf-16"))
    assert read_frf(path).receptance == pytest.approx(H, rel=1e-7)


def test_mixed_units_and_damaged_numbers_are_rejected(tmp_path: Path) -> None:
    mixed = put(tmp_path / "a.csv", "Freq (Hz),Real (um/N),Imag (m/N)\n" + rows(F, H.real, H.imag, separator=","))
    assert re.search("Real .*'um/N'.* Imag .*'m/N'", complaint(mixed))
    volts = put(tmp_path / "b.csv", "Freq (Hz),Real (V/N),Imag (V/N)\n" + rows(F, H.real, H.imag, separator=","))
    assert re.search("sensor.* V/N .*Description.sensitivity", complaint(volts))
    for spoilt in (F[::-1], np.where(F == 9, F - 1, F)):
        path = put(tmp_path / "c.csv", "Freq (Hz),Real (m/N),Imag\n" + rows(spoilt, H.real, H.imag, separator=","))
        assert "frequency must" in complaint(path)
    word = put(tmp_path / "d.csv", "Freq (Hz),Real (m/N),Imag\n1,2,3\n2,overflow,3\n3,4,5\n")
    with pytest.raises(DataError, match=r"d\.csv: .*Real .*'overflow' in line 3,"):
        read_recording(word)
