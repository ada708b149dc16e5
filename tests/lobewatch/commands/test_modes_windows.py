"""`lobewatch modes` of records that ring on, that were windowed, and of FRFs with a coherence."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Structure, infer_averages
from lobewatch.cli import main
from lobewatch.measurement import Window, fit_file_modes
from modal import Mode, Trust, assess_trust, synthesize_frf
from tests.modal.quality.test_assess_mode import MODE, noisy

FREQUENCY, DAMPING, STIFFNESS = 500.0, 0.005, 3e7
STRUCTURE = Structure(np.array([FREQUENCY, 1400.0]), np.array([DAMPING, 0.03]), np.array([STIFFNESS, 5e7]))
RATE = 25600.0
DECAY = 2 * np.pi * FREQUENCY * DAMPING


def hit(path: Path, seconds: float, *, before: float = 0.02, tau: float = np.inf, noise: float = 2.0) -> Path:
    """One hit on that structure, its record ending so long after the hit, its response windowed from the start on."""
    random, size, width = np.random.default_rng(1), int((before + seconds) * RATE), 0.6e-3
    time = np.arange(size) / RATE
    after = time >= before
    response = np.zeros(size)
    response[after] = STRUCTURE.response(time[after] - before, width)
    force = np.where(after & (time < before + width), np.sin(np.pi * (time - before) / width) ** 4, 0.0)
    force = 250 * force + random.normal(scale=noise / 40, size=size)
    response = (250 * response + random.normal(scale=noise, size=size)) * np.exp(-time / tau)
    columns = np.stack([time, force, response], axis=1)
    np.savetxt(path, columns, delimiter=",", header="time_s,force_N,acceleration_m/s^2", comments="", fmt="%.9g")
    return path


def first(modes: tuple[Mode, ...]) -> Mode:
    return min(modes, key=lambda mode: abs(mode.frequency - FREQUENCY))


def distance(mode: Mode) -> NDArray[np.float64]:
    """From the truth, in half widths of the 95 % interval."""
    values = np.array([mode.frequency - FREQUENCY, mode.damping_ratio - DAMPING, mode.stiffness - STIFFNESS])
    return np.asarray(np.abs(values) / (mode.quantile() * mode.standard_error))


def codes(remarks: Any) -> set[str]:
    return {remark.code for remark in remarks}


def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *args: str) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["lobewatch", "modes", *args])
    with pytest.raises(SystemExit) as end:
        main()
    printed = capsys.readouterr()
    return int(str(end.value.code or 0)), printed.out + printed.err


@pytest.mark.parametrize("left", [0.02, 0.05, 0.2])
def test_modes_of_hits_that_ring_on_hold_the_truth(tmp_path: Path, left: float) -> None:
    file = hit(tmp_path / "hit.csv", -np.log(left) / DECAY)
    found = fit_file_modes(file)
    assert "windowed-here" in codes(found.remarks)
    mode = first(found.fitted)
    assert np.all(distance(mode) < 1)
    assert mode.stiffness == pytest.approx(STIFFNESS, rel=0.02)
    assert assess_trust(mode) is Trust.TRUSTED


def test_ringing_can_be_accepted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = hit(tmp_path / "hit.csv", np.log(5) / DECAY)
    as_it_is = fit_file_modes(file, accept=["not-decayed"])
    assert codes(as_it_is.remarks) >= {"hits-accepted"}
    assert "windowed-here" not in codes(as_it_is.remarks)
    assert assess_trust(first(as_it_is.fitted)) is Trust.DOUBTFUL
    code, said = run(monkeypatch, capsys, str(file), "--accept", "not-decayed")
    assert code == 0
    assert "hits" in said
    code, said = run(monkeypatch, capsys, str(file), "--accept", "double-hit")
    assert code == 2
    assert "not-decayed" in said


def test_a_window_that_began_before_the_hit_is_taken_out_of_stiffness(tmp_path: Path) -> None:
    tau = -0.01 / np.log(1 / 1.23)
    file = hit(tmp_path / "hit.csv", 0.4, before=0.01, tau=tau, noise=0.02)
    known = first(fit_file_modes(file, window=Window(tau)).fitted)
    ignored = first(fit_file_modes(file, window=Window(tau, start=0.0102)).fitted)
    assert ignored.stiffness / STIFFNESS == pytest.approx(1.23, rel=0.01)
    assert known.stiffness == pytest.approx(STIFFNESS, rel=0.003)
    assert known.damping_ratio == pytest.approx(DAMPING, rel=0.01)


def test_the_time_of_the_hit_is_asked_for_where_only_an_frf_is_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    frf = noisy([MODE])
    file = tmp_path / "frf.csv"
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag], axis=1)
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N)", comments="")
    code, said = run(monkeypatch, capsys, str(file), "--window", "0.05")
    assert code == 2
    assert "--hit-at" in said
    code, said = run(monkeypatch, capsys, str(file), "--window", "0.05", "--window-start", "0.02", "--hit-at", "0.01")
    assert code == 2
    assert "--window-start 0.02" in said
    stiffness = []
    for hit_at in ("0", "0.01"):
        code, said = run(monkeypatch, capsys, str(file), "--window", "0.05", "--hit-at", hit_at, "--json")
        assert code == 0
        stiffness.append(json.loads(said)["modes"][0]["stiffness_n_per_m"])
    assert stiffness[1] / stiffness[0] == pytest.approx(np.exp(-0.01 / 0.05), rel=1e-9)


@pytest.mark.parametrize(
    ("named", "options"), [("", ["--window", "0.05"]), ("exponential 0.05 s", []), ("flat top", [])]
)
def test_the_time_of_the_hit_is_asked_for_with_all_else(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, named: str, options: list[str]
) -> None:
    frf = noisy([MODE])
    file = tmp_path / "frf.csv"
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag], axis=1)
    np.savetxt(file, table, header=f"# window: {named}\nFreq(Hz) Real Imag", comments="")
    code, said = run(monkeypatch, capsys, str(file), *options)
    assert code == 2
    assert "--unit" in said
    assert "--hit-at" in said
    assert ("--window" in said) is (named == "flat top")
    more = ["--window", "0.05"] if named == "flat top" else options
    code, said = run(monkeypatch, capsys, str(file), "--unit", "m/N", "--hit-at", "0", *more)
    assert code == 0, said


@pytest.mark.parametrize("hits", [3, 10, 30])
def test_averages_are_inferred_from_scatter_and_coherence(hits: int) -> None:
    assert infer_averages(noisy([MODE], level=0.01, hits=hits)) == pytest.approx(hits, rel=0.25)
    assert infer_averages(noisy([MODE], level=0.01, hits=2)) is None


def test_coherence_of_an_frf_counts_where_its_averages_are_known(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    frf = noisy([MODE], level=0.01)
    assert frf.coherence is not None
    poor = np.where(np.abs(frf.frequency - 1722) < 100, 0.45, frf.coherence)
    file = tmp_path / "frf.csv"
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag, poor], axis=1)
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N) Coherence", comments="")
    inferred = fit_file_modes(file)
    assert "averages-inferred" in codes(inferred.remarks)
    assert inferred.frf is not None
    assert inferred.frf.n_averages == pytest.approx(10, abs=3)
    code, said = run(monkeypatch, capsys, str(file), "--averages", "10", "--json")
    assert code == 0
    assert json.loads(said)["n_averages"] == 10
    assert json.loads(said)["remarks"][:1] == [] or "averages" not in json.loads(said)["remarks"][0]["code"]
    code, said = run(monkeypatch, capsys, str(file), "--averages", "0")
    assert code == 2
    assert "--averages 0" in said
    code, said = run(monkeypatch, capsys, str(hit(tmp_path / "hit.csv", 0.4)), "--averages", "10")
    assert code == 2
    assert "--averages" in said


def test_doubtful_modes_stand_below_the_trusted_ones_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    frf = noisy([Mode(900.0, 0.02, 4e7), MODE])
    file = tmp_path / "frf.csv"
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag], axis=1)
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N)", comments="")
    code, said = run(monkeypatch, capsys, str(file), "--band", "890", "4000")
    assert code == 0
    rows = said.splitlines()
    assert rows[2].split(".")[0].strip() == "1722"
    assert rows[3].startswith("   899.97")
    assert rows[3].rstrip().endswith("!")
    assert rows[4].startswith("1 trusted, 1 doubtful, 0 rejected")
    assert rows[5].startswith("!")
    assert "cut-by-edge" in rows[5]


def test_rejected_modes_are_counted_and_shown_with_all(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    frf = noisy([Mode(900.0, 0.4, 2e6), MODE], level=1e-4)
    file = tmp_path / "frf.csv"
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag], axis=1)
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N)", comments="", fmt="%.12e")
    said, brief, everything = (run(monkeypatch, capsys, str(file), *more)[1] for more in (["--json"], [], ["--all"]))
    trusts = [mode["trust"] for mode in json.loads(said)["modes"]]
    assert trusts.count("rejected") == 1
    assert "1 rejected" in brief
    assert "heavy-damping" not in brief
    assert "rejected: " in everything
    assert "heavy-damping" in everything


def test_a_mode_that_outlasts_the_window_is_left_out_and_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A line of hum or a clock looks like a mode of hardly any damping; the others have their answer all the same."""
    sharp = Mode(600.0, 0.0002, 3e9)
    lines = np.arange(400.0, 3000.0, 0.25)
    receptance = synthesize_frf([sharp, MODE], lines).receptance
    file = tmp_path / "frf.csv"
    table = np.stack([lines, receptance.real, receptance.imag], axis=1)
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N)", comments="")
    code, said = run(monkeypatch, capsys, str(file), "--window", "0.5", "--hit-at", "0", "--json")
    assert code == 0
    (mode,) = json.loads(said)["modes"]
    assert mode["frequency_hz"] == pytest.approx(MODE.frequency, rel=1e-3)
    assert ("slower-than-window", "600 Hz") in [(r["code"], r["about"]) for r in json.loads(said)["remarks"]]
    code, said = run(monkeypatch, capsys, str(file), "--window", "0.5", "--hit-at", "0", "--band", "500", "700")
    assert code == 2
    assert "600" in said


def stiffness_at(frequency: float, modes: Sequence[Mode]) -> float:
    return min(modes, key=lambda mode: abs(mode.frequency - frequency)).stiffness


def test_a_window_that_nobody_named_is_reported_with_its_time_constant(tmp_path: Path) -> None:
    path = hit(tmp_path / "windowed.csv", 0.5, tau=0.05)
    silent = fit_file_modes(path)
    (said,) = [remark for remark in silent.remarks if remark.code == "window-suspected"]
    assert "0.05 s" in said.text
    assert "Window.time_constant" in said.cure
    assert stiffness_at(FREQUENCY, silent.fitted) / STIFFNESS > 1.2
    named = fit_file_modes(path, window=Window(0.05))
    assert "window-suspected" not in [remark.code for remark in named.remarks]
    assert stiffness_at(FREQUENCY, named.fitted) == pytest.approx(STIFFNESS, rel=0.03)
    assert "window-suspected" not in [remark.code for remark in fit_file_modes(hit(tmp_path / "x.csv", 0.5)).remarks]
