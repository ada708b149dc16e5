"""Complex modal constants behind the verdict: drawn with their errors, kept in history, series, bands, predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from lobes import lower_envelope, program_limit, read_history, write_history, zero_order_lobes
from lobewatch.history.history import HistoryRow, decode_row, encode_row, make_empty_history, make_export_columns
from lobewatch.machine import Machine
from lobewatch.measurement.estimate import Estimate
from lobewatch.tool import Assembly
from lobewatch.tool.assembly import predict_assembly
from lobewatch.tool.tap_series import FollowedMode, compute_scatter
from lobewatch.verdicts.monte_carlo import LIMIT_QUANTILES, N_BAND_SAMPLES, compute_limit_band
from lobewatch.verdicts.program_case import build_program
from lobewatch.verdicts.program_samples import build_median_row
from lobewatch.verdicts.uncertainty import uncertainty_of
from lobewatch.verdicts.verdict import evaluate_program
from modal import Mode

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
START = datetime(2026, 1, 15, tzinfo=UTC)
COVARIANCE = np.array([[0.25, 1e-5, 4e4], [1e-5, 1e-8, 50.0], [4e4, 50.0, 4e11]]) / 25
SURE = """
[doubt]
frequency_percent = 0
damping_percent = 0
stiffness_percent = 0
speed_percent = 0
coefficients_percent = 0
"""


def turned(phase_deg: float, std: float = 0.0) -> Mode:
    """Its phase goes with its frequency and against its stiffness."""
    correlation = np.array([0.7, 0.2, -0.3])
    return Mode(
        1713.0, 0.03, 3.5e7, COVARIANCE, 500.0, phase_deg=phase_deg, phase_deg_std=std, phase_correlation=correlation
    )


def of(modes: Sequence[Mode]) -> Assembly:
    """Return a tool tapped alike in both directions."""
    return Assembly("reference", START, "T", modes, modes, ("x", "y"), None, {"x": "T", "y": "T"}, False, ())


@pytest.fixture
def machine(shop: Shop) -> Machine:
    """One program, and no uncertainty except that of the tap test."""
    shop.run(("A", 11000, 0.5))
    shop.edit("[speed]", f"{SURE}\n[speed]")
    found: Machine = shop.folder.machine
    return found


def test_samples_have_the_joint_covariance_of_the_tap_test(machine: Machine) -> None:
    mode, (table,) = turned(-25.0, 1.5), machine.program
    assembly = of([mode])
    middle = build_median_row(build_program(table, machine), assembly)
    doubt = uncertainty_of(assembly, table, machine)
    rows = doubt.sample(middle, 20000)
    values = rows.frequency / (2 * np.pi), rows.damping_ratio, rows.stiffness, np.degrees(rows.phase)
    error = np.sqrt(np.diag(mode.joint_covariance))
    for axis in (0, 1):
        drawn = np.array([value[:, axis] for value in values])
        assert np.corrcoef(drawn) == pytest.approx(mode.joint_covariance / np.outer(error, error), abs=0.03)
        assert np.std(drawn, axis=1) == pytest.approx(mode.quantile() / np.sqrt(3) * error, rel=0.03)
        assert np.mean(drawn[3]) == pytest.approx(-25.0, abs=0.1)
    known = doubt.sample(middle, 10, without="tap")
    assert known.phase == pytest.approx(np.full((10, 2), np.radians(-25.0)), rel=1e-12)


def test_errors_of_modes_whose_phase_was_not_fitted_are_drawn_apart(machine: Machine) -> None:
    (table,) = machine.program
    middle = build_median_row(build_program(table, machine), of([turned(0.0)]))
    rows = uncertainty_of(of([turned(0.0)]), table, machine).sample(middle, 20000)
    assert not np.any(rows.phase)
    assert np.corrcoef(rows.frequency[:, 0], rows.stiffness[:, 0])[0, 1] == pytest.approx(0.0, abs=0.03)


def test_the_verdict_is_that_of_the_complex_modes(machine: Machine) -> None:
    (table,) = machine.program
    limits = {}
    for phase in (-30.0, 0.0, 30.0):
        found = evaluate_program(table, of([turned(phase)]), machine)
        program = build_program(table, machine)
        assert found.samples is not None
        assert found.limit == program_limit(program, [turned(phase)], [turned(phase)], found.samples.cuts).limit
        assert 0.97 * found.limit < found.limit_low < found.limit < found.limit_high < 1.03 * found.limit
        limits[phase] = found.limit
    assert limits[-30.0] < 0.9 * limits[0.0] < 0.7 * limits[30.0]


def test_the_band_is_that_of_the_drawn_complex_modes(machine: Machine) -> None:
    (table,), cuts = machine.program, machine.cuts("reference")["A"]
    assembly, speeds = of([turned(20.0, 4.0)]), np.linspace(8000.0, 14000.0, 12)
    line = lower_envelope([zero_order_lobes(assembly.x, assembly.y, cut, speeds) for cut in cuts])
    band = compute_limit_band(line, "A", assembly, machine)
    rows = uncertainty_of(assembly, table, machine).sample(
        build_median_row(build_program(table, machine), assembly), N_BAND_SAMPLES
    )
    limits = []
    for i in range(N_BAND_SAMPLES):
        drawn = rows.frequency[i] / (2 * np.pi), rows.damping_ratio[i], rows.stiffness[i], np.degrees(rows.phase[i])
        x, y = ([Mode(f, zeta, k, phase_deg=phase)] for f, zeta, k, phase in np.transpose(drawn).tolist())
        limits.append(lower_envelope([zero_order_lobes(x, y, cut, speeds) for cut in cuts]).depth)
    low, high = np.quantile(limits, LIMIT_QUANTILES, axis=0)
    assert band.low == pytest.approx(np.minimum(low, line.depth), rel=0.04)
    assert band.high == pytest.approx(np.maximum(high, line.depth), rel=0.04)
    assert np.median(band.high / band.low) > 1.06


def test_history_keeps_the_phase(shop: Shop) -> None:
    machine = shop.folder.machine
    row = HistoryRow(
        "T",
        START,
        "reference",
        "x",
        *(Estimate(1713.0, 0.5), Estimate(0.03, 1e-4), Estimate(3.5e7, 1e5), Estimate(-12.5, 0.4)),
        modes=((1713.0, 0.03, 3.5e7, -12.5), (2900.0, 0.02, 9e7, 8.0)),
    )
    path = shop.path / "history.h5"
    write_history(path, make_export_columns(replace(make_empty_history(machine), rows=(row,)), machine))
    stored = read_history(path)
    number, read = decode_row(encode_row(3, row, {}), {})
    assert number == 3
    assert stored.columns["mode_phase_deg"][0, :2].tolist() == [-12.5, 8.0]
    assert (stored.units["phase_deg"], stored.units["mode_phase_deg"]) == ("deg", "deg")
    assert (read.phase_deg, read.modes) == (row.phase_deg, row.modes)
    assert read.mode is not None
    assert read.mode.constant == turned(-12.5).constant


def test_a_series_tells_the_scatter_of_its_phases() -> None:
    phases = np.random.default_rng(0).normal(10.0, 2.0, 200)
    series = [
        FollowedMode(START + timedelta(days=i), 1713.0, 0.03, 3.5e7, phase) for i, phase in enumerate(phases.tolist())
    ]
    scatter = compute_scatter(series)
    assert scatter is not None
    assert scatter[:3] == (0.0, 0.0, 0.0)
    assert scatter.phase_deg == pytest.approx(1.97 * 2.0, rel=0.15)


def test_the_softest_mode_of_a_predicted_tool_has_the_phase_of_the_mode_followed(shop: Shop) -> None:
    shop.tap(0, 1713.0, stiffness=3.5e7)
    logbook = shop.logbook
    measured = logbook.measurement(logbook.taps[0].id)
    followed = replace(measured.followed, phase_deg=-20.0)
    assembly = predict_assembly(logbook.machine, [replace(measured, followed=followed)], "reference")
    softest, *others = sorted(assembly.x or (), key=lambda mode: mode.stiffness)
    assert (softest.phase_deg, {mode.phase_deg for mode in others} <= {0.0}) == (-20.0, True)
    (table, *_) = logbook.machine.program
    widths = uncertainty_of(assembly, table, logbook.machine).modes["prediction"]
    assert np.max(widths[:, 3]) == pytest.approx(np.radians(20.0))
