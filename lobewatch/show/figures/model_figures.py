"""Pictures of the model: the shaft to scale, mode shapes, f(k), whirl speeds, tip FRF."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from acquisition import Frf
from dsm import Modes, Segment, Spindle, WhirlMap
from lobewatch.logbook.model_picture import ModelPicture
from lobewatch.show.figures.style import ALARM, GOOD, NOW, STYLE, THEN

_Float = NDArray[np.float64]
STEEL = "#c9d3dc"
SHAPES = ((NOW, "-"), (ALARM, "--"), (GOOD, "-."), (THEN, ":"))
"""Colour and dashes of the modes, in order."""


def model_figure(picture: ModelPicture) -> Figure:
    """All pictures of the model on one page."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 10.0), layout="constrained")
        axes: dict[str, Axes] = figure.subplot_mosaic(
            [["shaft", "curve"], ["shapes", "whirl"], ["frf", "frf"]], height_ratios=[0.8, 1.2, 1.1]
        )
        figure.suptitle(picture.title)
    draw_shaft(axes["shaft"], picture.spindle)
    draw_shapes(axes["shapes"], picture.modes)
    axes["shapes"].sharex(axes["shaft"])
    draw_curve(axes["curve"], picture.curve, picture.points)
    draw_whirl(axes["whirl"], picture.whirl, picture.highest_speed)
    draw_frf(axes["frf"], picture.model_frf, picture.measured_frf)
    axes["frf"].set_title(f"frequency response {picture.frf_place}")
    return figure


def draw_shaft(axes: Axes, spindle: Spindle) -> None:
    """Longitudinal section to scale, the tool tip at the left; bearings are triangles, joints dashed lines."""
    start = 0.0
    for segment in spindle.segments:
        _draw_segment(axes, segment, start)
        start += segment.length
    for bearing in spindle.bearings:
        radius = _radius_at(spindle, bearing.position) * 1e3
        for side in (-1, 1):
            marker = "^" if side < 0 else "v"
            axes.plot(bearing.position * 1e3, side * (radius + 5), marker, color=NOW, ms=7, mec="white", mew=0.5)
    for mass in spindle.masses:
        axes.plot(mass.position * 1e3, 0, "o", color=ALARM, ms=9, mec="white")
    for joint in spindle.joints:
        axes.axvline(joint.position * 1e3, color=ALARM, ls="--", lw=1)
    axes.axhline(0, color="black", lw=0.6, ls=(0, (12, 3, 2, 3)))
    axes.set(xlabel="distance from the tool tip (mm)", ylabel="radius (mm)", title="shaft, to scale")
    axes.set_xlim(-0.02 * start * 1e3, 1.02 * start * 1e3)
    axes.set_aspect("equal", adjustable="datalim", anchor="C")
    axes.grid(visible=False)


def _draw_segment(axes: Axes, segment: Segment, start: float) -> None:
    z = np.array([start, start + segment.length]) * 1e3
    outer, bore = np.array([segment.diameters_at(share) for share in (0.0, 1.0)]).T * 500
    for side in (-1, 1):
        if segment.mass_diameter is not None:
            axes.fill_between(z, side * outer, side * segment.mass_diameter * 500, color=STEEL, alpha=0.4, lw=0)
        axes.fill_between(z, side * bore, side * outer, facecolor=STEEL, edgecolor="#5b6770", lw=0.8)


def _radius_at(spindle: Spindle, position: float) -> float:
    """Largest outer radius of the segments that reach a place (m)."""
    ends = np.cumsum([0.0, *(segment.length for segment in spindle.segments)])
    slack = 1e-6 * ends[-1]
    near = [
        max(segment.diameters_at(0.0)[0], segment.diameters_at(1.0)[0])
        for segment, a, b in zip(spindle.segments, ends[:-1], ends[1:], strict=True)
        if a - slack <= position <= b + slack
    ]
    return max(near) / 2


def draw_shapes(axes: Axes, modes: Modes) -> None:
    """Deflection of each mode, scaled to its largest, upwards at the tip."""
    for number, (colour, dashes) in zip(range(modes.frequency.size), SHAPES, strict=False):
        shape = modes.deflection[number]
        shape = shape / np.max(np.abs(shape)) * (np.sign(shape[0]) or 1.0)
        label = f"mode {number + 1}: {modes.frequency[number]:.0f} Hz"
        axes.plot(modes.position * 1e3, shape, color=colour, ls=dashes, lw=1.6, label=label)
    axes.axhline(0, color="black", lw=0.6)
    axes.set(xlabel="distance from the tool tip (mm)", ylabel="deflection / its largest (-)", title="mode shapes")
    axes.set_ylim(-1.1, 1.1)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=8, ncols=2)


def draw_curve(axes: Axes, curve: tuple[_Float, _Float], points: tuple[_Float, _Float]) -> None:
    """Frequency over bearing stiffness, with the tap tests on it."""
    axes.semilogx(curve[0] / 1e6, curve[1], color=NOW, lw=1.6, label="model")
    if points[0].size:
        axes.plot(points[0] / 1e6, points[1], "o", color=THEN, ms=4, label="tap tests")
        axes.plot(points[0][-1] / 1e6, points[1][-1], "o", color=ALARM, ms=7, mec="white", label="newest")
    axes.set(xlabel="bearing stiffness (N/µm)", ylabel="frequency (Hz)", title="followed mode over bearing stiffness")
    axes.legend(loc="lower right")


def draw_whirl(axes: Axes, whirl: WhirlMap, highest_speed: float) -> None:
    """Forward and backward whirl over speed, seen from the housing and from the shaft."""
    speed = whirl.speed_rpm / 1e3
    for number, (colour, _) in zip(range(whirl.forward.shape[0]), SHAPES, strict=False):
        first = number == 0
        lines: Sequence[tuple[_Float, str, str]] = (
            (whirl.forward[number], "-", "forward, from the housing"),
            (whirl.backward[number], "--", "backward, from the housing"),
            (whirl.rotating_forward[number], "-", "the same, turning with the shaft"),
            (whirl.rotating_backward[number], "--", ""),
        )
        for index, (values, dashes, label) in enumerate(lines):
            style: dict[str, Any] = {"lw": 1.5, "alpha": 1.0} if index < 2 else {"lw": 0.8, "alpha": 0.55}
            axes.plot(speed, values, color=colour, ls=dashes, label=label if first and label else None, **style)
    top = float(np.max(whirl.forward)) * 1.1
    axes.plot(speed, whirl.speed_rpm / 60, color="black", lw=1, ls=":", label="once a revolution")
    axes.axvspan(0, highest_speed / 1e3, color=GOOD, alpha=0.10, lw=0, label="speed range of the machine")
    axes.set(xlabel="spindle speed (1000 rpm)", ylabel="frequency (Hz)", title="whirl speeds")
    axes.set(xlim=(0, speed[-1]), ylim=(0, top))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=8, ncols=2)


def draw_frf(axes: Axes, model: Frf, measured: Frf | None) -> None:
    """Magnitude of receptance, model against measured."""
    if measured is not None:
        shown = measured.in_band((float(model.frequency[0]), float(model.frequency[-1])))
        axes.semilogy(shown.frequency, np.abs(shown.receptance) * 1e9, color=THEN, lw=1.0, label="measured, newest")
    axes.semilogy(model.frequency, np.abs(model.receptance) * 1e9, color=NOW, lw=1.6, ls="--", label="model")
    axes.set(xlabel="frequency (Hz)", ylabel="|receptance| (nm/N)")
    axes.set_xlim(model.frequency[0], model.frequency[-1])
    axes.legend(loc="upper right")
