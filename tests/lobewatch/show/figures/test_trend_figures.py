"""Test that figures draw their data at the right places."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from itertools import combinations

import msgspec
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.dates import date2num

from acquisition import Frf
from lobewatch.machine import LimitsTable, ProgramTable
from lobewatch.measurement import Estimate
from lobewatch.show.figures.drawing import new_axes, render_svg
from lobewatch.show.figures.lobe_figures import plot_lobes, plot_waterfall
from lobewatch.show.figures.response_drawing import compute_phase
from lobewatch.show.figures.trend_figures import SeriesValue, ValueTrend, plot_frf, plot_trend
from lobewatch.verdicts import Setting, Stability, Verdict
from modal import Mode, find_unexplained_peaks, synthesize_frf
from tests.lobewatch.show.figures.lobe_diagrams import diagram_of

TIMES = [datetime(2026, month, 1, tzinfo=UTC) for month in (1, 2, 3)]


def trend_of(*values: float) -> ValueTrend:
    """Return a trend of frequencies with a standard error of 0.5 Hz."""
    estimates = [(time, Estimate(value, 0.5)) for time, value in zip(TIMES, values, strict=False)]
    return ValueTrend(SeriesValue("frequency", "f", "Hz", 1.0, ""), estimates)


def test_limits_stand_below_the_first_value() -> None:
    figure = plot_trend(trend_of(1700.0, 1690.0, 1650.0)._replace(limits=LimitsTable()))
    data = [np.asarray(line.get_xydata()) for line in figure.axes[0].lines]
    levels = [points[0, 1] for points in data if points[0, 0] == 0]
    assert levels == pytest.approx([1700 * 0.95, 1700 * 0.90])


def test_bars_are_the_95_percent_interval() -> None:
    figure = plot_trend(trend_of(1700.0))
    (bars,) = figure.axes[0].collections
    assert isinstance(bars, LineCollection)
    ((low, high),) = [np.asarray(segment)[:, 1] for segment in bars.get_segments()]
    assert (low, high) == pytest.approx((1700 - 0.98, 1700 + 0.98))


def test_events_are_lines_with_their_text_and_what_does_not_count_is_hollow() -> None:
    events = [(TIMES[1], "bearings greased with the new grease of the maker")]
    figure = plot_trend(trend_of(*3 * [1700.0])._replace(events=events, excluded=[(TIMES[2], 1600.0)]))
    *_, hollow, event = figure.axes[0].lines
    assert hollow.get_markerfacecolor() == "none"
    assert np.asarray(hollow.get_xydata()).tolist() == [[date2num(TIMES[2]), 1600.0]]
    assert np.asarray(event.get_xdata())[0] == date2num(TIMES[1])
    assert "bearings greased with the…" in [text.get_text() for text in figure.axes[0].texts]


def chattering(name: str) -> Verdict:
    cut = {"teeth": 2, "radial_depth_mm": 5, "tool_diameter_mm": 10, "direction": "up", "material": "any"}
    program = ProgramTable(name=name, speed_rpm=1500.0, depth_mm=3.0, **cut)  # type: ignore[arg-type]
    return Verdict(program, Stability.NOT_STABLE)


def drawn(name: str, speed_rpm: float, depth_mm: float) -> Verdict:
    program = msgspec.structs.replace(chattering(name).program, speed_rpm=speed_rpm, depth_mm=depth_mm)
    return Verdict(program, Stability.NOT_STABLE)


def test_labels_of_the_report_figure_do_not_overlap() -> None:
    """Test that programs without room for a name keep their mark."""
    speed = np.linspace(3000.0, 24000.0, 50)
    names = ["A: slot at 12 600 rpm", "B: slot at 6 200 rpm", "C: slot at 16 000 rpm"]
    places = [(12600.0, 2.5), (6200.0, 0.8), (16000.0, 0.5)]
    crowd = [drawn(f"one of many programs {i}", 12000.0 + 300 * i, 1.5) for i in range(8)]
    programs = [*(drawn(name, *place) for name, place in zip(names, places, strict=True)), *crowd]
    pockets = [Setting(11440.0, 2.5, (11330.0, 11670.0), 0.5, 0.02)]
    figure = plot_lobes(
        diagram_of(speed, {"now": np.full(50, 7e-4)}, verdicts=programs, pockets=pockets), is_small=True
    )
    (axes,) = figure.axes
    shown = [text for text in axes.texts if text.get_text()]
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in shown]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    words = [text.get_text() for text in shown]
    assert words[:3] == names
    assert len(words) < len(programs) == sum(line.get_marker() == "X" for line in axes.lines)


def test_lobes_are_drawn_in_mm_and_programs_where_they_cut() -> None:
    speed = np.linspace(1000.0, 2000.0, 5)
    depths = {"then": np.full(5, 2e-3), "now": np.full(5, 1e-3)}
    figure = plot_lobes(diagram_of(speed, depths, verdicts=[chattering("A")]))
    now, earlier, mark = figure.axes[0].lines
    assert earlier.get_ydata() == pytest.approx(2.0)
    assert now.get_ydata() == pytest.approx(1.0)
    assert np.asarray(mark.get_xydata()).tolist() == [[1500.0, 3.0]]
    assert render_svg(figure).startswith("<svg")


def test_a_map_without_any_limit_ends_at_a_millimetre() -> None:
    speed = np.linspace(1000.0, 2000.0, 5)
    (mesh,) = plot_waterfall(speed, TIMES, np.full((3, 5), np.inf)).axes[0].collections
    assert mesh.get_clim() == (0, 1)


def test_receptance_is_drawn_in_nm_per_n() -> None:
    f = np.linspace(1.0, 100.0, 50)
    figure = plot_frf(None, Frf(f, np.full(50, 2e-9 - 5e-9j)), (1.0, 100.0))
    size, phase = (axes.lines[0].get_ydata() for axes in figure.axes)
    assert size == pytest.approx(np.hypot(2.0, 5.0))
    assert phase == pytest.approx(np.degrees(np.arctan2(-5.0, 2.0)))


def test_the_fit_and_the_peaks_that_it_misses_are_drawn_and_named() -> None:
    f, modes = np.arange(100.0, 1500.0), [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)]
    frf = replace(synthesize_frf(modes, f), coherence=np.full(f.size, 0.97))
    (peak,) = missed = find_unexplained_peaks(frf, modes[:1])
    amplitude, phase, coherence = plot_frf(None, frf, (100.0, 1500.0), modes[:1], missed).axes
    _, fit, mark = amplitude.lines
    assert fit.get_ydata() == pytest.approx(1e9 * np.abs(modes[0].receptance(f)))
    assert np.asarray(mark.get_xydata())[0] == pytest.approx(
        [peak.frequency, 1e9 * abs(np.interp(peak.frequency, f, frf.receptance))]
    )
    assert f"{peak.frequency:.0f}" in str(mark.get_label())
    assert mark.get_marker() != "None"
    assert np.interp(500.0, f, np.asarray(phase.lines[1].get_ydata())) == pytest.approx(-90.0, abs=0.5)
    assert coherence.lines[0].get_ydata() == pytest.approx(0.97)
    assert plot_frf(None, frf, (100.0, 1500.0), modes).axes[0].lines[-1].get_marker() == "None"


@pytest.mark.parametrize("lowest", [-270.0, -90.0])
def test_a_phase_stays_within_one_turn_and_is_not_joined_across_it(lowest: float) -> None:
    angle = np.radians(np.linspace(-500.0, 500.0, 1001))
    phase = compute_phase(np.exp(1j * angle), lowest)
    known = phase[np.isfinite(phase)]
    assert np.all((known >= lowest) & (known < lowest + 360.0))
    assert np.exp(1j * np.radians(known)) == pytest.approx(np.exp(1j * angle[np.isfinite(phase)]))
    assert 1 <= np.count_nonzero(np.isnan(phase)) <= 3
    assert np.isnan(compute_phase(np.zeros(3, complex), lowest)).all()


@pytest.mark.parametrize("name", [r"cost $5 to $6 \frac", r"cost $5 \frac to $6", "$x$", r"a_b^c \$ $"])
def test_no_name_is_read_as_a_formula(name: str) -> None:
    speed = np.linspace(1000.0, 2000.0, 5)
    diagram = diagram_of(speed, {name: np.full(5, 1e-3)}, verdicts=[chattering(name)])
    picture = render_svg(plot_lobes(diagram, name))
    assert picture.count(f">{name}</text>") == 3


def test_logarithmic_axes_have_plain_numbers() -> None:
    figure, (axes,) = new_axes(1, (4.0, 3.0))
    axes.semilogy([1.0, 2.0], [1e-3, 100.0])
    picture = render_svg(figure)
    assert "$" not in picture
    assert [f">{label}</text>" in picture for label in ("1e\u221203", "1e\u221201", "1", "100")] == [True] * 4
