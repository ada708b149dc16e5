"""Signals over time as recorders leave them: several hits in one record, volts, velocity, windows, two machines."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from acquisition import (
    DataError,
    Description,
    HitFlags,
    Structure,
    check_hit,
    convert,
    inspect_file,
    read_frf,
    read_hits,
)

RATE = 8000.0
STRUCTURE = Structure(np.array([400.0]), np.array([0.03]), np.array([2e7]))
WIDTH = 1e-3


def tapped(times: list[float], seconds: float, strength: float = 200.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, force (N) and acceleration (m/s^2) of a structure that is hit at these times."""
    time = np.arange(round(seconds * RATE)) / RATE
    force, response = np.zeros(time.size), np.zeros(time.size)
    for at in times:
        on = time >= at
        pulse = on & (time < at + WIDTH)
        force[pulse] += strength * np.sin(np.pi * (time[pulse] - at) / WIDTH) ** 4
        response[on] += strength * STRUCTURE.response(time[on] - at, WIDTH)
    noise = np.random.default_rng(1).normal(size=(2, time.size))
    return time, force + 0.02 * noise[0], response + 0.02 * noise[1]


def put(path: Path, heading: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), "%.9g", "\t", header=heading, comments="")
    return path


def test_hits_found_within_one_record_are_those_that_were_made_one_by_one(tmp_path: Path) -> None:
    time, force, response = tapped([0.3, 1.4, 2.6], 3.7)
    path = put(tmp_path / "three hits.txt", "time_s\tforce_N\tacc_m/s^2", time, force, response)
    hits = read_hits(path)
    begins = [round((at - 0.02) * RATE) for at in (0.3, 1.4, 2.6)]
    assert [check_hit(hit) for hit in hits] == [HitFlags.OK] * 3
    assert {hit.acceleration.size for hit in hits} == {hits[0].force.size}
    assert hits[0].force.size == pytest.approx(1.1 * RATE, abs=5)
    for hit, begin in zip(hits, begins, strict=True):
        assert hit.pre_trigger == 0.02 * RATE
        assert abs(int(np.argmax(hit.force)) - round((0.02 + WIDTH / 2) * RATE)) <= 3
        at = int(np.flatnonzero(np.isclose(force, hit.force[0], atol=1e-7))[0])
        assert abs(at - begin) <= 3
    facts = {fact.name: (fact.value, fact.origin) for fact in inspect_file(path).facts}
    assert facts["hits"][0].startswith("3 in one record")
    frf = read_frf(path)
    assert frf.n_averages == 3
    line = int(np.argmin(np.abs(frf.frequency - 400)))
    exact = 1 / (2e7 * (1 - (frf.frequency[line] / 400) ** 2 + 0.06j * frf.frequency[line] / 400))
    assert frf.receptance[line] == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize(
    ("times", "seconds", "counts"),
    [
        ([0.3], 1.4, [1]),
        ([0.3, 0.35], 1.4, [1]),  # a further touch
        ([0.3, 1.4, 1.45], 2.5, [2]),
        ([0.3, 1.4, 2.4], 2.45, [2]),  # the record ends behind the last
        ([0.0005, 1.1], 2.2, [2]),
    ],
)
def test_a_double_hit_is_no_hit_of_its_own(
    tmp_path: Path, times: list[float], seconds: float, counts: list[int]
) -> None:
    path = put(tmp_path / "a.txt", "time_s\tforce_N\tacc_m/s^2", *tapped(times, seconds))
    hits = read_hits(path)
    assert [len(hits)] == counts
    double = [HitFlags.DOUBLE_HIT in check_hit(hit) for hit in hits]
    assert any(double) == any(0 < b - a < 0.2 for a, b in pairwise(times))


def test_a_hit_before_the_structure_is_at_rest_is_none_of_its_own(tmp_path: Path) -> None:
    time, force, response = tapped([0.3, 0.6], 1.6)
    ringing = response + 40 * np.exp(-0.5 * time) * np.sin(2 * np.pi * 90 * time) * (time > 0.3)
    path = put(tmp_path / "a.txt", "time_s\tforce_N\tacc_m/s^2", time, force, ringing)
    (hit,) = read_hits(path)
    assert HitFlags.DOUBLE_HIT in check_hit(hit)


def test_channels_in_volts_are_asked_for_their_sensitivity(tmp_path: Path) -> None:
    time, force, response = tapped([0.3], 1.2)
    path = put(tmp_path / "a.txt", "time_s\tforce_V\tacc_mV", time, 2.25e-3 * force, 1e3 * 10e-3 / 9.80665 * response)
    assert 'force [V], acc [mV] (give Description.sensitivity, for example "' in inspect_file(path).problems
    assert "Description.sensitivity" in inspect_file(path, Description(sensitivity=("2.25 mV/N",))).problems
    said = Description(sensitivity=("2.25 mV/N", "10 mV/g"))
    (hit,) = read_hits(path, said)
    assert hit.force == pytest.approx(force, abs=1e-5)
    assert hit.acceleration == pytest.approx(response, abs=1e-4)
    assert ("sensitivity", "option") in [(fact.name, fact.origin) for fact in inspect_file(path, said).facts]
    for wrong in ("2.25", "2.25 N/mV", "0 mV/N", "2.25 mV/furlong"):
        text = inspect_file(path, Description(sensitivity=(wrong, "10 mV/g"))).problems
        assert f"Description.sensitivity {wrong!r}: " in text
    three = put(tmp_path / "c.txt", "time\tx_V\ty_V\tz_V", time, force, response, response)
    asked = inspect_file(three).problems
    assert [word in asked for word in ("Description.sensitivity", "Description.response", "Description.rate")] == [
        True
    ] * 3
    said = Description(sensitivity=("2.25 mV/N", "10 mV/g", "10 mV/g"), response=2, rate=RATE)
    assert inspect_file(three, said).problems == ""
    named = put(tmp_path / "b.txt", "time_s\tforce_N\tacc_g", time, force, response)
    assert "Description.sensitivity: " in inspect_file(named, said).problems


@pytest.mark.parametrize(("unit", "order", "factor"), [("mm/s", 1, 1e3), ("um", 2, 1e6)])
def test_velocity_and_displacement_over_time_give_the_frf_of_that_motion(
    tmp_path: Path, unit: str, order: int, factor: float
) -> None:
    time, force, response = tapped([0.3], 1.2)
    spectrum, omega = np.fft.rfft(response), 2 * np.pi * np.fft.rfftfreq(time.size, 1 / RATE)
    spectrum[0], omega[0] = 0.0, 1.0
    motion = np.fft.irfft(spectrum / (1j * omega) ** order, time.size)
    path = put(tmp_path / "a.txt", f"time_s\tforce_N\tresponse [{unit}]", time, force, factor * motion)
    direct = put(tmp_path / "b.txt", "time_s\tforce_N\tresponse [m/s^2]", time, force, response)
    ours, exact = read_frf(path), read_frf(direct)
    near = (exact.frequency > 100) & (exact.frequency < 1500)
    assert ours.receptance[near] == pytest.approx(exact.receptance[near], rel=1e-3)
    quantity = "velocity" if order == 1 else "displacement"
    assert quantity in {fact.name: fact.value for fact in inspect_file(path).facts}["note"]


def test_a_velocity_that_was_cut_off_is_an_overload(tmp_path: Path) -> None:
    time, force, response = tapped([0.3], 1.2)
    clipped = np.clip(response, -0.4 * response.max(), 0.4 * response.max())
    path = put(tmp_path / "a.txt", "time_s\tforce_N\tvelocity [mm/s]", time, force, clipped)
    (hit,) = read_hits(path)
    assert HitFlags.OVERLOAD_RESPONSE in check_hit(hit)


F = np.arange(4.0, 2000.0, 4.0)
H = 1 / (3.5e7 * (1 - (F / 700) ** 2 + 0.06j * F / 700))


def windowed_table(path: Path, window: str) -> Path:
    return put(path, f"# window: {window}\nFreq (Hz)\tReal (m/N)\tImag (m/N)", F, H.real, H.imag)


def windowed_mat(path: Path, window: str) -> Path:
    scipy.io.savemat(path, {"freq": F, "frf": H, "window": window})
    return path


def windowed_uff(path: Path, window: str) -> Path:
    table = windowed_table(path.with_suffix(".csv"), window)
    convert(table, path, Description())
    return path


@pytest.mark.parametrize(
    ("make", "name"), [(windowed_table, "a.csv"), (windowed_mat, "a.mat"), (windowed_uff, "a.uff")]
)
def test_a_window_that_a_file_names_is_known_from_it(tmp_path: Path, make: Callable[..., Path], name: str) -> None:
    said = Description(unit="m/N") if name == "a.mat" else Description()
    found = inspect_file(make(tmp_path / name, "exponential 50 ms"), said).require_valid()
    assert found.window == pytest.approx(0.05)
    assert ("window", "file") in [(fact.name, fact.origin) for fact in found.facts]
    assert inspect_file(make(tmp_path / name, "none"), said).window is None
    if name != "a.uff":
        assert inspect_file(make(tmp_path / name, "rectangular"), said).window is None
        assert np.isnan(inspect_file(make(tmp_path / name, "Hanning"), said).window or 0.0)


def test_the_window_of_signal_calc_is_seen_before_and_behind_it(tmp_path: Path) -> None:
    time, force, response = tapped([0.0], 0.5)
    window = np.exp(-time / 0.08)
    variables = {"H1_2": np.stack([F + 0j, H], axis=1), "X1": np.stack([time, force], axis=1)}
    variables |= {"X2": np.stack([time, response], axis=1), "W1": np.stack([time, force], axis=1)}
    variables["W2"] = np.stack([time, response * window], axis=1)
    scipy.io.savemat(tmp_path / "a.mat", variables)
    assert inspect_file(tmp_path / "a.mat").window == pytest.approx(0.08, rel=1e-3)
    variables["W2"] = np.stack([time, response * np.hanning(time.size)], axis=1)
    scipy.io.savemat(tmp_path / "b.mat", variables)
    assert np.isnan(inspect_file(tmp_path / "b.mat").window or 0.0)


@pytest.mark.parametrize("with_frf", [True, False])
def test_the_last_hit_of_signal_calc_is_taken_before_the_window(tmp_path: Path, with_frf: bool) -> None:
    time, force, response = tapped([0.0], 0.5)
    variables = {"H1_2": np.stack([F + 0j, H], axis=1)} if with_frf else {}
    variables |= {"X1": np.stack([time, force], axis=1), "X2": np.stack([time, response], axis=1)}
    variables["W2"] = np.stack([time, response * np.exp(-time / 0.08)], axis=1)
    scipy.io.savemat(tmp_path / "a.mat", variables | {"Unit": np.array(["N", "m/s^2"], dtype=object)})
    said = Description(columns=("time=X1:1", "force=X1:2", "acceleration=X2:2") if with_frf else ())
    recording = inspect_file(tmp_path / "a.mat", said).require_valid()
    assert recording.hits[0].acceleration == pytest.approx(response)
    assert recording.hits[0].force == pytest.approx(force)
    assert recording.window is None
    whole = inspect_file(tmp_path / "a.mat", Description(columns=("force=X1", "acceleration=X2:2"), rate=RATE)).problems
    assert "2 columns " in whole


def test_two_machines_in_one_file_are_rejected(tmp_path: Path) -> None:
    path = windowed_table(tmp_path / "a.csv", "none")
    convert(path, tmp_path / "a.uff", Description())
    text = (tmp_path / "a.uff").read_text()
    (tmp_path / "two.uff").write_text(text + text.replace("a.csv", "mill 4"))
    assert "(a.csv, mill 4)" in inspect_file(tmp_path / "two.uff").problems
    text = path.read_text()
    path.write_text(f"# machine: mill 3\n# machine: mill 4\n{text}")
    assert "(mill 3, mill 4)" in inspect_file(path).problems


def test_records_of_two_directions_or_machines_are_not_averaged(tmp_path: Path) -> None:
    path = put(tmp_path / "a.txt", "time_s\tforce_N\tacc_m/s^2", *tapped([0.05], 0.6))
    for direction in "xy":
        convert(path, tmp_path / f"{direction}.uff", Description(direction=direction), hits=True)
    both = tmp_path / "both.uff"
    both.write_text("".join((tmp_path / f"{one}.uff").read_text() for one in "xx"))
    assert not inspect_file(both).problems
    assert len(read_hits(both)) == 2
    both.write_text("".join((tmp_path / f"{one}.uff").read_text() for one in "xy"))
    with pytest.raises(DataError, match=r"\(1 x over 1 x .*Description\.columns"):
        read_hits(both)
    convert(path, tmp_path / "a.json", Description(), hits=True)
    text = (tmp_path / "a.json").read_text()
    one, other = text.replace("hit 1", "mill 3"), text.replace("hit 1", "lathe 1")
    (tmp_path / "a.json").write_text(f"{one[:-1]}, {other[1:]}")
    assert "(mill 3, lathe 1)" in inspect_file(tmp_path / "a.json").problems
