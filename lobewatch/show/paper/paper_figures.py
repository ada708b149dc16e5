"""The figures of the paper drawn anew from what was computed on the surrogate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dsm import WhirlMap, mode_shapes
from lobewatch.paper import PaperStudy, printed
from lobewatch.paper.fe_study import ELEMENTS
from lobewatch.paper.finite_elements import ElementKind
from lobewatch.show.figures.model_figures import draw_shaft, draw_shapes
from lobewatch.show.figures.style import ALARM, GOOD, NOW, THEN, new_axes

SIZE = (8.0, 4.4)
"""Inches."""
PAPER: dict[str, Any] = {"color": ALARM, "marker": "D", "ls": "", "ms": 7, "mec": "white", "zorder": 5}
"""Mark of a number of the paper."""
LIMITS = (1300.0, 2200.0)
"""Frequencies of Figs. 5 and 6 (Hz)."""
DEEP = 6.0
"""Depth up to which lobes are drawn, in lowest limits of the new spindle."""


def _shaft(study: PaperStudy) -> Figure:
    figure, (shaft, shapes) = new_axes(2, (8.0, 6.0))
    spindle = study.plain.new.spindle
    draw_shaft(shaft, spindle)
    shaft.set(title="surrogate, to scale: not the paper's dimensions", xlabel="")
    draw_shapes(shapes, mode_shapes(spindle, 3, np.linspace(0.0, spindle.length, 400)))
    return figure


def _convergence(study: PaperStudy) -> Figure:
    figure, (axes,) = new_axes(1, SIZE)
    looks: tuple[tuple[ElementKind, str, str, str], ...] = (
        ("linear", "straight lines with shear (as BEAM188)", ALARM, "s"),
        ("timoshenko", "cubics with shear", NOW, "o"),
        ("euler-bernoulli", "cubics without shear", GOOD, "^"),
    )
    for kind, label, colour, mark in looks:
        error = np.array(study.meshes.frequencies[kind]) / study.meshes.exact[kind] - 1
        axes.loglog(ELEMENTS, error, color=colour, marker=mark, label=label)
    paper = printed.FEM_FREQUENCY / printed.RIGID_FREQUENCY - 1
    axes.loglog(printed.FEM_ELEMENTS, paper, label="paper: FEM above DSM", **PAPER)
    axes.set(xlabel="elements", ylabel="share above the exact f_1 (-)")
    axes.legend(loc="lower left")
    return figure


def _real_part(study: PaperStudy) -> Figure:
    return _response(study, "Re")


def _imaginary_part(study: PaperStudy) -> Figure:
    return _response(study, "Im")


def _response(study: PaperStudy, part: str) -> Figure:
    figure, (axes,) = new_axes(1, SIZE)
    tap = study.tap

    def values(receptance: NDArray[np.complex128]) -> NDArray[np.float64]:
        return (receptance.real if part == "Re" else receptance.imag) * 1e6

    axes.plot(tap.frf.frequency, values(tap.frf.receptance), color=NOW, lw=1.8, label="mode with the paper's numbers")
    surrogate = f"surrogate, {len(tap.surrogate_modes)} modes"
    axes.plot(tap.surrogate_frf.frequency, values(tap.surrogate_frf.receptance), color=THEN, ls="--", label=surrogate)
    hits = tap.tapped.in_band(LIMITS)
    axes.plot(hits.frequency, values(hits.receptance), ".", color=GOOD, ms=5, label="ten emulated hits on it")
    if part == "Re":
        below, above = tap.extremes
        _mark(axes, tap.measured.receptance(np.array([below])).real[0] * 1e6, below, "omega_A")
        _mark(axes, tap.measured.receptance(np.array([above])).real[0] * 1e6, above, "omega_B")
    else:
        _mark(axes, tap.depth * 1e6, tap.measured.frequency, "D")
    axes.axhline(0, color="black", lw=0.6)
    axes.set(xlabel="frequency (Hz)", ylabel=f"{part} G (µm/N)", xlim=LIMITS)
    axes.legend(loc="lower left")
    return figure


def _mark(axes: Axes, height: float, frequency: float, name: str) -> None:
    axes.plot(frequency, height, color=ALARM, marker="o", ls="")
    text: dict[str, Any] = {"xytext": (10, 0), "textcoords": "offset points", "va": "center"}
    axes.annotate(f"{name}: {frequency:.1f} Hz, {height:.4f} µm/N", (frequency, height), **text)


def _rigid_whirl(study: PaperStudy) -> Figure:
    return _whirl((study.plain.rigid_whirl, study.shear.rigid_whirl), printed.RIGID_CRITICAL_SPEED)


def _free_whirl(study: PaperStudy) -> Figure:
    return _whirl((study.plain.whirl, study.shear.whirl), printed.CRITICAL_SPEED)


def _whirl(maps: tuple[WhirlMap, WhirlMap], critical: float) -> Figure:
    figure, (axes,) = new_axes(1, SIZE)
    plain, shear = maps
    speed = plain.speed_rpm / 1e3
    axes.plot(speed, plain.rotating_forward[0], color=NOW, lw=1.8, label="seen from the shaft, as in the paper")
    axes.plot(speed, plain.forward[0], color=GOOD, lw=1.8, ls="--", label="seen from the housing")
    label = "the same with shear and gyroscopic moments"
    axes.plot(speed, shear.rotating_forward[0], color=NOW, lw=0.9, ls=":")
    axes.plot(speed, shear.forward[0], color=GOOD, lw=0.9, ls=":", label=label)
    axes.plot(speed, shear.backward[0], color=GOOD, lw=0.9, ls=":")
    axes.plot(speed, plain.speed_rpm / 60, color="black", lw=0.8, ls="-.", label="once a revolution")
    axes.plot(critical / 1e3, 0, label="critical speed in the paper", clip_on=False, **PAPER)
    axes.set(xlabel="spindle speed (1000 rpm)", ylabel="first frequency (Hz)")
    axes.set(xlim=(0, speed[-1]), ylim=(0, 1.65 * plain.forward[0, 0]))
    axes.legend(loc="upper left", ncols=2, fontsize=9)
    return figure


def _curve(study: PaperStudy) -> Figure:
    figure, (axes,) = new_axes(1, SIZE)
    for shaft, name, dashes in (
        (study.plain, "Euler-Bernoulli, as in the paper", "-"),
        (study.shear, "Timoshenko", "--"),
    ):
        axes.semilogx(*shaft.curve, color=NOW, ls=dashes, label=f"surrogate, {name}")
        axes.axhline(shaft.rigid_frequency, color=THEN, lw=0.8, ls=dashes)
    axes.annotate("rigid bearings", (1.2e7, study.plain.rigid_frequency + 25), color=THEN, fontsize=9)
    points = (printed.BEARING_STIFFNESS, printed.OLD_BEARING_STIFFNESS), (printed.FREQUENCY, printed.OLD_FREQUENCY)
    axes.plot(*points, label="paper, new and old", **PAPER)
    axes.plot(1e13, printed.RIGID_FREQUENCY, label="paper, rigid", **(PAPER | {"marker": "s"}))
    axes.set(
        xlabel="stiffness of each bearing (N/m)", ylabel="first frequency (Hz)", xlim=(1e7, 1.5e13), ylim=(0, 2600)
    )
    axes.legend(loc="lower right")
    return figure


def _lobes(study: PaperStudy) -> Figure:
    figure, (axes,) = new_axes(1, SIZE)
    lobes = study.lobes
    looks = (
        (lobes.new, "new: 1722 Hz", THEN, "-"),
        (lobes.by_rule, "old, K x 0.9 as in the paper", ALARM, "-"),
        (lobes.by_model, "old, K of the model", NOW, "--"),
    )
    for chart, label, colour, dashes in looks:
        depth = np.minimum(chart.depth / lobes.new.minimum.depth, 2 * DEEP)
        axes.plot(chart.speed_rpm / 1e3, depth, color=colour, ls=dashes, lw=1.5, label=label)
    before, after = lobes.pocket
    axes.annotate(
        "", (after / 1e3, 5.2), (before / 1e3, 5.2), arrowprops={"arrowstyle": "->", "color": "black", "lw": 1.2}
    )
    axes.set(xlabel="spindle speed (1000 rpm)", ylabel="limiting depth / lowest limit, new (-)")
    axes.set(xlim=(lobes.new.speed_rpm[0] / 1e3, lobes.new.speed_rpm[-1] / 1e3), ylim=(0, DEEP))
    axes.legend(loc="upper left")
    return figure


class PaperFigure(NamedTuple):
    """A figure of the page."""

    caption: str
    """What it shows."""
    draw: Callable[[PaperStudy], Figure]
    """Function that draws it."""


FIGURES: Mapping[str, PaperFigure] = {
    "fig-3": PaperFigure("Fig. 3: the surrogate with its ten bearings, and its first modes", _shaft),
    "fig-8": PaperFigure("Fig. 8: the first frequency over the stiffness of each bearing", _curve),
    "convergence": PaperFigure("Finite elements against the exact first frequency", _convergence),
    "fig-7": PaperFigure("Fig. 7: the first frequency over speed, rigid bearings", _rigid_whirl),
    "fig-9": PaperFigure("Fig. 9: the first frequency over speed, bearings calibrated to 1722 Hz", _free_whirl),
    "fig-5": PaperFigure("Fig. 5: real part of the receptance at the tool tip", _real_part),
    "fig-6": PaperFigure("Fig. 6: its imaginary part", _imaginary_part),
    "fig-10": PaperFigure("Fig. 10: stability lobes, new and after a fall of f_1 by 10 %", _lobes),
}
"""Figures 3 and 5 to 10, and the convergence of the finite elements, by the names of their files."""
