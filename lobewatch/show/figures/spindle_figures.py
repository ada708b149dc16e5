"""Plot measured modes and the spindle model."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from acquisition import Frf
from dsm import Modes, Segment, Spindle, WhirlMap, format_with_error
from lobewatch.arrays import Complexes, Floats
from lobewatch.logbook import ModelFigureData
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.show.figures.drawing import FIGURE_STYLE, Paint
from lobewatch.show.figures.response_drawing import compute_phase, mark_unexplained, set_coherence_axis, set_phase_axis
from modal import (
    Extraction,
    Mode,
    Trust,
    assess_trust,
    candidate_frequencies,
    find_unexplained_peaks,
    stabilisation_charts,
)

CIRCLES_PER_ROW = 4
"""Number of circles in a row."""
MAX_CIRCLES = 8
"""Largest number of circles: the most trusted modes, then those with the highest peaks."""
MIN_LABEL_SPACING = 0.014
"""Smallest distance between labels of close modes (share of the axis)."""
LEGEND_SHARE = 0.08
"""Room for a row of the legend below all lines (share of the axis)."""
MAX_TITLE_LETTERS = 90
"""Largest number of letters in a line of the title."""
ORDER_AXIS_TOP = 10.5
"""Upper end of the axis of model orders."""
SMALL_PART_HEIGHT = 1.2
"""Height of the phase and of the coherence (inches)."""
LOWEST_PHASE = -90.0
"""Lowest phase shown of an accelerance (degrees), far from the 0 to 180 degrees of a driving point."""
CIRCLE_HALF_WIDTHS = 3.0
"""Range of a circle on either side of its resonance (half-power half-widths)."""


VERTICAL_LABEL: dict[str, Any] = {"rotation": 90, "ha": "center", "va": "bottom"}
TRUST_MARKS = {Trust.TRUSTED: "", Trust.DOUBTFUL: " ?", Trust.REJECTED: " -"}
"""Mark after the frequency of a mode."""


def plot_modes(state: Extraction, modes: Sequence[Mode], title: str) -> Figure:
    """Plot the accelerance with its fit and residual, the stabilization chart, and a mobility circle of each mode.

    Phase and coherence are below the accelerance. Triangles mark peaks that the accepted modes do not explain. Stable
    poles without a mode are labelled. Free decays are shown as the spectrum of the first one, without phase and
    circles.
    """
    circles = sorted((mode for mode in modes if mode.has_stiffness), key=_circle_rank)[:MAX_CIRCLES]
    rows, is_frf = -(-len(circles) // CIRCLES_PER_ROW), all(mode.has_stiffness for mode in modes)
    parts = [_draw_phase] if is_frf else []
    parts += [_draw_coherence] if is_frf and state.frf.coherence is not None else []
    heights = [3.2, *len(parts) * [SMALL_PART_HEIGHT], 2.2, *rows * [2.4]]
    with mpl.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=(9.0, 0.6 + sum(heights)), layout="constrained")
        grid = figure.add_gridspec(len(heights), CIRCLES_PER_ROW, height_ratios=heights)
        top = figure.add_subplot(grid[0, :])
        chart = figure.add_subplot(grid[1 + len(parts), :], sharex=top)
        _draw_accelerance(top, state, modes)
        _draw_stabilization_chart(chart, state, modes)
        for k, mode in enumerate(sorted(circles, key=lambda mode: mode.frequency)):
            row = len(heights) - rows + k // CIRCLES_PER_ROW
            _draw_circle(figure.add_subplot(grid[row, k % CIRCLES_PER_ROW]), state, mode)
        for row, draw in enumerate(parts, 1):
            draw(figure.add_subplot(grid[row, :], sharex=top), state)
    top.set_title(
        fill(title, MAX_TITLE_LETTERS), pad=10 + 6 * max((len(_mode_label(mode)) for mode in modes), default=0)
    )
    return figure


def _circle_rank(mode: Mode) -> tuple[int, float]:
    """Return a sort key: trusted modes first, among them those with the highest peak."""
    return list(Trust).index(assess_trust(mode)), -(mode.frequency**2) * mode.peak


def _draw_accelerance(axes: Axes, state: Extraction, modes: Sequence[Mode]) -> None:
    f = state.frf.frequency
    axes.semilogy(f, np.abs(state.frf.accelerance), color=Paint.FIRST, lw=0.8, label="measured")
    labels = "fit in the fitted bands", "measured - fit"
    for band in state.bands:
        part, left = f[band.lines], state.residual(band)[0]
        size = (2 * np.pi * part) ** 2
        fitted = np.abs(state.frf.receptance[band.lines] - left) * size
        axes.semilogy(part, fitted, color=Paint.NEWEST, ls="--", label=labels[0])
        axes.semilogy(part, np.abs(left) * size, color=Paint.ALARM, lw=0.6, label=labels[1])
        labels = "", ""
    is_frf = all(mode.has_stiffness for mode in modes)
    accepted = [mode for mode in modes if assess_trust(mode) is not Trust.REJECTED]
    peaks = find_unexplained_peaks(state.frf, accepted) if is_frf else ()
    peaks = tuple(peak for peak in peaks if not peak.is_within_errors)
    mark_unexplained(axes, peaks, f, np.abs(state.frf.accelerance))
    places = _spread_labels([mode.frequency for mode in modes], MIN_LABEL_SPACING * (f[-1] - f[0]))
    for mode, place in zip(modes, places, strict=True):
        coordinates = ("data", "axes fraction"), "offset points"
        axes.annotate(_mode_label(mode), (place, 1.0), (0, 2), *coordinates, fontsize=8, **VERTICAL_LABEL)
    low, high = axes.get_ylim()
    axes.set_ylabel("|accelerance| (m/s²/N)" if is_frf else "|spectrum of a decay| (m/s)")
    rows = 2 if peaks else 1
    axes.set(xlim=(f[0], f[-1]), ylim=(low * (low / high) ** (rows * LEGEND_SHARE), high))
    axes.tick_params(labelbottom=False)
    axes.legend(loc="lower right", ncols=2 if peaks else 3)


def _draw_phase(axes: Axes, state: Extraction) -> None:
    f = state.frf.frequency
    axes.plot(f, compute_phase(state.frf.accelerance, LOWEST_PHASE), color=Paint.FIRST, lw=0.8)
    for band in state.bands:
        fitted = -(state.frf.receptance[band.lines] - state.residual(band)[0])  # phase of the accelerance
        axes.plot(f[band.lines], compute_phase(fitted, LOWEST_PHASE), color=Paint.NEWEST, ls="--")
    set_phase_axis(axes, LOWEST_PHASE)
    axes.tick_params(labelbottom=False)


def _draw_coherence(axes: Axes, state: Extraction) -> None:
    if state.frf.coherence is not None:
        axes.plot(state.frf.frequency, state.frf.coherence, color=Paint.FIRST, lw=0.8)
    set_coherence_axis(axes)
    axes.tick_params(labelbottom=False)


def _mode_label(mode: Mode) -> str:
    return f"{_frequency_text(mode.frequency)}{TRUST_MARKS[assess_trust(mode)]}"


def _frequency_text(frequency: float) -> str:
    return f"{frequency:.0f}" if frequency >= 100 else f"{frequency:.3g}"


def _spread_labels(places: Sequence[float], least: float) -> list[float]:
    """Return rising positions, each moved up to the least distance from the one before."""
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + least) if moved else place)
    return moved


def _draw_stabilization_chart(axes: Axes, state: Extraction, modes: Sequence[Mode]) -> None:
    for band in state.bands:
        axes.axvspan(*state.frf.frequency[band.lines][[0, -1]], color=Paint.FIRST, alpha=0.10, lw=0)
        chart = band.data.chart
        axes.plot(chart.frequency[~chart.stable], chart.order[~chart.stable], "x", color=Paint.FIRST, ms=3)
    for chart in stabilisation_charts(state):
        axes.plot(chart.frequency[chart.stable], chart.order[chart.stable], "o", color=Paint.NEWEST, ms=3)
    axes.plot([], [], "x", color=Paint.FIRST, ms=3, label="pole (in the fitted bands)")
    axes.plot([], [], "o", color=Paint.NEWEST, ms=3, label="stable pole")
    for mode in modes:
        axes.axvline(mode.frequency, color=Paint.NEWEST, lw=0.6)
    others = candidate_frequencies(state).tolist()
    places = _spread_labels(others, MIN_LABEL_SPACING * np.ptp(axes.get_xlim()))
    for frequency, place in zip(others, places, strict=True):
        text, style = _frequency_text(frequency), {"fontsize": 7, "color": Paint.NEWEST, **VERTICAL_LABEL}
        axes.annotate(text, (place, ORDER_AXIS_TOP), **style)
    axes.set(
        xlabel="frequency (Hz), grey: fitted bands, blue: stable pole without a mode, ? doubtful mode, - rejected mode"
    )
    axes.set(ylabel="order", ylim=(0, ORDER_AXIS_TOP + 3))
    axes.yaxis.set_major_locator(MultipleLocator(2))
    axes.legend(loc="lower right", ncols=2, frameon=True, framealpha=0.9, edgecolor="none")


def _draw_circle(axes: Axes, state: Extraction, mode: Mode) -> None:
    """Draw the mobility circle of a mode near its resonance: measured minus all other modes, and fitted.

    The line from the origin to the natural frequency has the angle of the modal constant: 0 degrees for a real mode of
    a driving point.
    """
    band = min(state.bands, key=lambda band: float(np.min(np.abs(band.fit.frequency - mode.frequency))))
    f = state.frf.frequency[band.lines]
    reach = CIRCLE_HALF_WIDTHS * mode.damping_ratio * mode.frequency
    near = np.abs(f - mode.frequency) < reach
    fine = np.linspace(mode.frequency - reach, mode.frequency + reach, 300)
    points = _mobility(f, mode.receptance(f) + state.residual(band)[0])[near]
    curve = _mobility(fine, mode.receptance(fine))
    top = complex(np.exp(1j * np.angle(mode.constant)) * np.max(np.abs(curve)))
    axes.axhline(0.0, color=Paint.FIRST, lw=0.5)
    axes.plot(points.real, points.imag, ".", color=Paint.FIRST, ms=4, label="measured")
    axes.plot(curve.real, curve.imag, color=Paint.NEWEST, lw=1, label="fit")
    axes.plot([0.0, top.real], [0.0, top.imag], color=Paint.ALARM, lw=1, label="phase")
    axes.set_aspect("equal", adjustable="datalim")
    phase = f"phase {format_with_error(mode.phase_deg, mode.phase_deg_std or None)}°" if mode.phase_deg else "real"
    named = f"{_frequency_text(mode.frequency)} Hz{TRUST_MARKS[assess_trust(mode)]}"
    axes.set_title(f"{named}: {phase}\nmobility (mm/s/N)", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.yaxis.set_major_locator(MaxNLocator(4))


def _mobility(frequency: Floats, receptance: Complexes) -> Complexes:
    """Return the mobility (mm/s/N)."""
    return np.asarray(2j * np.pi * 1e3 * frequency * receptance)


STEEL_GREY = "#c9d3dc"
MODE_LINES = ((Paint.NEWEST, "-"), (Paint.ALARM, "--"), (Paint.GOOD, "-."), (Paint.FIRST, ":"))
"""Paint and dashes of the modes, in order."""


def plot_model(picture: ModelFigureData) -> Figure:
    """Plot all figures of a model on one page."""
    with mpl.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=(12.0, 10.0), layout="constrained")
        rows = [["shaft", "curve"], ["shapes", "whirl"], ["frf", "frf"]]
        axes: dict[str, Axes] = figure.subplot_mosaic(rows, height_ratios=[0.8, 1.2, 1.1])
        figure.suptitle(picture.title)
    draw_shaft(axes["shaft"], picture.spindle)
    draw_shapes(axes["shapes"], picture.modes)
    axes["shapes"].sharex(axes["shaft"])
    draw_stiffness_curve(axes["curve"], picture.curve, picture.points)
    draw_whirl(axes["whirl"], picture.whirl, picture.highest_speed)
    draw_model_frf(axes["frf"], picture.model_frf, picture.measured_frf)
    axes["frf"].set_title(f"frequency response {picture.frf_place}")
    return figure


def draw_shaft(axes: Axes, spindle: Spindle) -> None:
    """Draw the shaft to scale, the tool tip at the left, with triangles for bearings and dashed lines for joints."""
    start, scale = 0.0, 1e3 * LENGTH.scale
    for segment in spindle.segments:
        _draw_segment(axes, segment, start)
        start += segment.length
    for bearing in spindle.bearings:
        z, radius = bearing.position * scale, (_radius_at(spindle, bearing.position) + 5e-3) * scale
        for y, marker in ((-radius, "^"), (radius, "v")):
            axes.plot(z, y, marker, color=Paint.NEWEST, ms=7, mec="white", mew=0.5)
    for mass in spindle.masses:
        axes.plot(mass.position * scale, 0, "o", color=Paint.ALARM, ms=9, mec="white")
    for joint in spindle.joints:
        axes.axvline(joint.position * scale, color=Paint.ALARM, ls="--", lw=1)
    axes.axhline(0, color="black", lw=0.6, ls=(0, (12, 3, 2, 3)))
    axes.set(
        xlabel=f"distance from the tool tip ({LENGTH.unit})", ylabel=f"radius ({LENGTH.unit})", title="shaft, to scale"
    )
    axes.set_xlim(-0.02 * start * scale, 1.02 * start * scale)
    axes.set_aspect("equal", adjustable="datalim", anchor="C")
    axes.grid(visible=False)


def _draw_segment(axes: Axes, segment: Segment, start: float) -> None:
    scale = 1e3 * LENGTH.scale
    z, half = np.array([start, start + segment.length]) * scale, scale / 2
    outer, bore = np.array([segment.diameters_at(share) for share in (0.0, 1.0)]).T * half
    for side in (-1, 1):
        if segment.mass_diameter is not None:
            axes.fill_between(z, side * outer, side * segment.mass_diameter * half, color=STEEL_GREY, alpha=0.4, lw=0)
        axes.fill_between(z, side * bore, side * outer, facecolor=STEEL_GREY, edgecolor="#5b6770", lw=0.8)


def _radius_at(spindle: Spindle, position: float) -> float:
    """Return the largest outer radius (m) of the segments at a position (m)."""
    ends = np.cumsum([0.0, *(segment.length for segment in spindle.segments)])
    slack = 1e-6 * ends[-1]
    places = zip(spindle.segments, ends[:-1], ends[1:], strict=True)
    near = [segment for segment, a, b in places if a - slack <= position <= b + slack]
    return max(segment.diameters_at(share)[0] for segment in near for share in (0.0, 1.0)) / 2


def draw_shapes(axes: Axes, modes: Modes) -> None:
    """Draw the deflection of each mode over its maximum, positive at the tip."""
    for number, (colour, dashes) in zip(range(modes.frequency.size), MODE_LINES, strict=False):
        shape = modes.deflection[number]
        shape = shape / np.max(np.abs(shape)) * (np.sign(shape[0]) or 1.0)
        label = f"mode {number + 1}: {modes.frequency[number]:.0f} Hz"
        axes.plot(modes.position * (1e3 * LENGTH.scale), shape, color=colour, ls=dashes, lw=1.6, label=label)
    axes.axhline(0, color="black", lw=0.6)
    axes.set(
        xlabel=f"distance from the tool tip ({LENGTH.unit})", ylabel="deflection / maximum (-)", title="mode shapes"
    )
    axes.set_ylim(-1.1, 1.1)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=8, ncols=2)


def draw_stiffness_curve(axes: Axes, curve: tuple[Floats, Floats], points: tuple[Floats, Floats]) -> None:
    """Draw frequency over bearing stiffness, with the tap tests."""
    axes.semilogx(curve[0] / 1e6, curve[1], color=Paint.NEWEST, lw=1.6, label="model")
    if points[0].size:
        axes.plot(points[0] / 1e6, points[1], "o", color=Paint.FIRST, ms=4, label="tap tests")
        axes.plot(points[0][-1] / 1e6, points[1][-1], "o", color=Paint.ALARM, ms=7, mec="white", label="newest")
    axes.set(xlabel="bearing stiffness (N/µm)", ylabel="frequency (Hz)", title="followed mode over bearing stiffness")
    axes.legend(loc="lower right")


def draw_whirl(axes: Axes, whirl: WhirlMap, highest_speed: float) -> None:
    """Draw forward and backward whirl frequencies over speed, in the fixed and in the rotating frame."""
    speed = whirl.speed_rpm / 1e3
    for number, (colour, _) in zip(range(whirl.forward.shape[0]), MODE_LINES, strict=False):
        lines: Sequence[tuple[Floats, str, float, float, str]] = (
            (whirl.forward, "-", 1.5, 1.0, "forward, fixed frame"),
            (whirl.backward, "--", 1.5, 1.0, "backward, fixed frame"),
            (whirl.rotating_forward, "-", 0.8, 0.55, "rotating frame"),
            (whirl.rotating_backward, "--", 0.8, 0.55, ""),
        )
        for values, dashes, lw, alpha, label in lines:
            label = label if number == 0 else ""
            axes.plot(speed, values[number], color=colour, ls=dashes, label=label, lw=lw, alpha=alpha)
    top = float(np.max(whirl.forward)) * 1.1
    axes.plot(speed, whirl.speed_rpm / 60, color="black", lw=1, ls=":", label="once per revolution")
    axes.axvspan(0, highest_speed / 1e3, color=Paint.GOOD, alpha=0.10, lw=0, label="speed range of the machine")
    axes.set(xlabel="spindle speed (1000 rpm)", ylabel="frequency (Hz)", title="whirl speeds")
    axes.set(xlim=(0, speed[-1]), ylim=(0, top))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=8, ncols=2)


def draw_model_frf(axes: Axes, model: Frf, measured: Frf | None) -> None:
    """Draw the magnitude of the receptance of the model and of the newest tap test."""
    if measured is not None:
        shown = measured.in_band((float(model.frequency[0]), float(model.frequency[-1])))
        size = np.abs(shown.receptance) * 1e9
        axes.semilogy(shown.frequency, size, color=Paint.FIRST, lw=1.0, label="measured, newest")
    axes.semilogy(model.frequency, np.abs(model.receptance) * 1e9, color=Paint.NEWEST, lw=1.6, ls="--", label="model")
    axes.set(xlabel="frequency (Hz)", ylabel="|receptance| (nm/N)")
    axes.set_xlim(model.frequency[0], model.frequency[-1])
    axes.legend(loc="upper right")
