"""`lobewatch modes`: printed text and figures show the right numbers."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Annotation

from acquisition import Frf, Remark, from_accelerance
from lobewatch.cli import main
from lobewatch.measurement import check_modes_together
from lobewatch.show.figures.spindle_figures import plot_modes
from lobewatch.show.modes import mode_notes, mode_remark_lines, mode_table, peak_picking_table
from lobewatch.show.terminal.output import results
from modal import (
    Mode,
    candidate_frequencies,
    edit_modes,
    extract_modes,
    fit_modes,
    modes_from_extraction,
    parse_mode_edits,
    pick_peaks,
    synthesize_frf,
)

LINES = np.arange(5.0, 4000.0, 5.0)
MODES = [Mode(900.0, 0.02, 4e7), Mode(1722.0, 0.03, -3.5e7)]


def noisy() -> Frf:
    exact = synthesize_frf(MODES, LINES).accelerance
    noise = np.random.default_rng(0).normal(size=(2, LINES.size)) * 1e-3 * np.max(np.abs(exact))
    return from_accelerance(LINES, exact + noise[0] + 1j * noise[1])


def command(monkeypatch: pytest.MonkeyPatch, *args: str) -> int:
    monkeypatch.setattr(sys, "argv", ["lobewatch", "modes", *args])
    with pytest.raises(SystemExit) as end:
        main()
    return int(str(end.value.code or 0))


def test_report_of_a_table_has_percent_correlation_and_remarks(capsys: pytest.CaptureFixture[str]) -> None:
    covariance = np.array([[4.0, 0, 0], [0, 9e-8, -0.8 * 3e-4 * 7e5], [0, -0.8 * 3e-4 * 7e5, 4.9e11]])
    mode = Mode(1722.0, 0.03, 3.5e7, covariance, remarks=(Remark("a-code", "1722 Hz", "a reason", "a cure"),))
    other = Mode(900.0, 0.03, -1e7, remarks=(Remark("a-code", "900 Hz", "a reason", "a cure"),))
    with results.capture() as shown:
        results.print(mode_table([mode]))
    assert "1722.0 ± 2.0 " in shown.get()
    assert "35.00 ± 0.70 (2 %)" in shown.get()
    (note,) = mode_notes([mode])
    assert "-0.80 (1722 Hz)" in note
    assert mode_remark_lines([mode, other], [Remark("whole", "", "all")]) == [
        "1722 Hz, 900 Hz: a reason. a cure.",
        "all",
    ]


def test_every_negative_stiffness_is_a_swapped_sign() -> None:
    both = [Mode(900.0, 0.02, -4e7), Mode(1722.0, 0.03, -3.5e7)]
    assert [remark.code for remark in check_modes_together(both)] == ["sign-swapped"]
    assert check_modes_together(MODES) == []


def test_peak_picking_is_held_against_the_fit() -> None:
    frf = noisy()
    with results.capture() as shown:
        results.print(peak_picking_table([*pick_peaks(frf), Mode(3000.0, 0.01, 1e8)], fit_modes(frf)))
    first, second, third = shown.get().splitlines()[1:4]
    assert "zeta" in first
    assert "K" in second
    assert third.rstrip().endswith("not fitted")


def test_figure_draws_fit_residual_poles_and_circles() -> None:
    frf = noisy()
    state, modes = extract_modes([frf]), fit_modes(frf)
    figure = plot_modes(state, modes, "x")
    top, chart, *others = figure.axes
    circles = [axes for axes in others if "mobility" in axes.get_title()]
    assert len(circles) == len(modes) == 2
    measured, fitted, left = (np.asarray(line.get_ydata()) for line in top.lines[:3])
    part = state.bands[0].lines
    assert measured == pytest.approx(np.abs(frf.accelerance))
    assert fitted == pytest.approx(np.abs(frf.accelerance[part]), abs=6e-3 * np.max(measured))
    assert np.sqrt(np.mean(left**2)) == pytest.approx(np.sqrt(2) * 1e-3 * np.max(measured), rel=0.2)
    stable = np.concatenate([line.get_xdata() for line in chart.lines if line.get_marker() == "o"])
    assert np.any(np.abs(stable - 900) < 1)
    points, circle, phase = (
        np.asarray(line.get_xydata()) for line in circles[0].lines if line.get_label() in ("measured", "fit", "phase")
    )
    assert "real" in circles[0].get_title()
    assert np.degrees(np.arctan2(*phase[1][::-1])) == pytest.approx(0, abs=0.5)
    radius = np.pi * 900 / (2 * 0.02 * 4e7) * 1e3
    assert np.hypot(circle[:, 0] - radius, circle[:, 1]) == pytest.approx(radius, rel=0.02)
    assert np.hypot(points[:, 0] - radius, points[:, 1]) == pytest.approx(radius, rel=0.1)


@pytest.mark.parametrize("degrees", [-40.0, 25.0])
def test_figure_writes_and_draws_the_phase_of_a_complex_mode(degrees: float) -> None:
    mode = Mode(1722.0, 0.03, -3.5e7, phase_deg=degrees, phase_deg_std=1.5)
    circle = plot_modes(extract_modes([synthesize_frf([mode], LINES)]), [mode], "x").axes[2]
    assert f"phase {degrees:.1f} ± 1.5°" in circle.get_title()
    (phase,) = (np.asarray(line.get_xydata()) for line in circle.lines if line.get_label() == "phase")
    x, y = phase[1] - phase[0]
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(degrees + (180 if degrees < 0 else -180))
    radius = np.pi * 1722 / (0.03 * 3.5e7) * 1e3
    assert np.hypot(x, y) == pytest.approx(radius, rel=0.05)


def test_figure_keeps_labels_of_close_modes_apart() -> None:
    close = [Mode(1700.0, 0.01, 4e7), Mode(1704.0, 0.01, 4e7), Mode(1706.0, 0.01, 4e7)]
    top = plot_modes(extract_modes([noisy()]), close, "x").axes[0]
    places = [label.xy[0] for label in top.texts if isinstance(label, Annotation)]
    assert places[0] == 1700.0
    assert np.all(np.diff(places) >= 0.01 * (LINES[-1] - LINES[0]))


def test_command_says_where_a_peak_may_be_cut(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    frf = noisy().in_band((1722.0, 4000.0))
    file = tmp_path / "frf.csv"
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag], axis=1)
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N)", comments="")
    assert command(monkeypatch, str(file)) == 0
    printed = capsys.readouterr().out
    assert command(monkeypatch, str(file), "--json") == 0
    remarks = json.loads(capsys.readouterr().out)["remarks"]
    assert [(one["code"], one["about"]) for one in remarks] == [("mode-missing-at-edge", "1725 Hz"), ("no-mode", "")]
    assert f"1725 Hz: {remarks[0]['text']}. {remarks[0]['cure']}." in printed


def test_command_corrects_an_exponential_window_and_draws(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    frf = noisy()
    table = np.stack([frf.frequency, frf.receptance.real, frf.receptance.imag], axis=1)
    file = tmp_path / "frf.csv"
    np.savetxt(file, table, header="Freq(Hz) Real(m/N) Imag(m/N)", comments="")
    assert command(monkeypatch, str(file), "--json") == 0
    plain = json.loads(capsys.readouterr().out)["modes"][1]
    assert [(remark["code"], remark["about"]) for remark in plain["remarks"]] == [("not-driving-point", "1722 Hz")]
    assert plain["interval_95"][0][0] < 1722 < plain["interval_95"][0][1]
    picture = tmp_path / "modes.png"
    assert command(monkeypatch, str(file), "--json", "--window", "0.1", "--hit-at", "0", "--figure", str(picture)) == 0
    corrected = json.loads(capsys.readouterr().out)["modes"][1]
    added = 1 / (2 * np.pi * 1722 * 0.1)
    assert plain["damping_ratio"] - corrected["damping_ratio"] == pytest.approx(added, rel=0.01)
    assert picture.stat().st_size > 10_000
    np.savetxt(file, table * [1, 1, -1], header="Freq(Hz) Real(m/N) Imag(m/N)", comments="")
    assert command(monkeypatch, str(file)) == 2
    assert "--conjugate" in capsys.readouterr().err
    np.savetxt(file, table * [1, 1, -1], header="Freq(Hz) Real Imag", comments="")
    assert command(monkeypatch, str(file)) == 2
    first = capsys.readouterr().err
    assert re.search(r"Real.*--unit.*m/N", first)
    assert "--conjugate" in first
    assert command(monkeypatch, str(file), "--conjugate") == 2
    assert "phase" not in capsys.readouterr().err
    assert command(monkeypatch, str(file), "--unit", "m/N", "--conjugate", "--json") == 0
    assert json.loads(capsys.readouterr().out)["modes"][1]["damping_ratio"] == pytest.approx(plain["damping_ratio"])
    assert command(monkeypatch, str(file), "--conjugate", "--window", "-1", "--hit-at", "0") == 2
    assert "-1" in capsys.readouterr().err


@pytest.mark.parametrize("skew", [15e-6, -15e-6])
def test_a_delay_between_the_channels_is_offered_as_skew(skew: float) -> None:
    modes = [Mode(700.0, 0.02, 6e7), Mode(1500.0, 0.03, 3e7), Mode(2600.0, 0.02, 9e7)]
    late = synthesize_frf(modes, LINES).receptance * np.exp(2j * np.pi * LINES * skew)
    (said,) = check_modes_together(fit_modes(Frf(LINES, late)))
    assert said.code == "channel-delay"
    found = re.search(r"(-?[\d.]+) ± ([\d.]+) us", said.text)
    assert found is not None
    assert float(found[1]) == pytest.approx(1e6 * skew, abs=float(found[2]))


def test_figure_draws_phase_coherence_and_the_peaks_that_the_modes_miss() -> None:
    exact = synthesize_frf([Mode(900.0, 0.02, 4e7), Mode(1722.0, 0.03, 3.5e7)], LINES)
    state = extract_modes([replace(exact, coherence=np.full(LINES.size, 0.95), n_averages=5)])
    modes = modes_from_extraction(state)
    top, *_, phase, coherence = plot_modes(state, modes, "x").axes
    assert [line for line in top.lines if line.get_marker() == "v"] == []
    assert coherence.lines[0].get_ydata() == pytest.approx(0.95)
    measured, fitted = (np.asarray(line.get_xydata()) for line in phase.lines[:2])
    assert np.interp(900.0, *measured.T) == pytest.approx(90.0, abs=5.0)
    assert np.interp(900.0, *fitted.T) == pytest.approx(np.interp(900.0, *measured.T), abs=0.5)
    (marks,) = (line for line in plot_modes(state, modes[:1], "x").axes[0].lines if line.get_marker() == "v")
    ((frequency, size),) = np.asarray(marks.get_xydata()).tolist()
    assert frequency == pytest.approx(1722.0, rel=0.02)
    assert size == pytest.approx(np.interp(frequency, LINES, np.abs(exact.accelerance)))
    assert f"{frequency:.0f}" in str(marks.get_label())


def test_figure_without_coherence_or_force_leaves_their_parts_out() -> None:
    labels = [axes.get_ylabel() for axes in plot_modes(extract_modes([noisy()]), fit_modes(noisy()), "x").axes]
    assert "coherence" not in labels
    assert sum("phase" in label for label in labels) == 1
    decays = [replace(mode, stiffness=np.nan, relative_peak=1.0) for mode in fit_modes(noisy())]
    assert len(plot_modes(extract_modes([noisy()]), decays, "x").axes) == 2


def test_figure_names_stable_poles_that_are_no_modes() -> None:
    modes = [*MODES, Mode(2800.0, 0.005, 1e8)]
    state = edit_modes(extract_modes([synthesize_frf(modes, LINES)]), parse_mode_edits(drop=["2800"]))
    chart = plot_modes(state, modes_from_extraction(state), "x").axes[1]
    assert "2800" in [text.get_text() for text in chart.texts]
    assert candidate_frequencies(state) == pytest.approx([2800.0], rel=1e-3)


def test_poles_that_are_hardly_a_part_of_what_was_measured_are_not_named() -> None:
    assert candidate_frequencies(extract_modes([noisy()])).size == 0
