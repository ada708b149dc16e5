"""Write a page of the comparison with the paper, with its figures."""

from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np
from matplotlib.axes import Axes

from acquisition import DataError
from acquisition.file_io import atomic_write, make_folder
from dsm import mode_shapes
from lobewatch.arrays import Complexes, Floats
from lobewatch.paper import PaperStudy, printed
from lobewatch.paper.finite_elements import ELEMENT_COUNTS, ElementKind
from lobewatch.show.figures.drawing import Paint, new_axes, save_figure
from lobewatch.show.figures.spindle_figures import draw_shaft, draw_shapes
from lobewatch.show.paper.paper_text import paper_cells

PAPER_FIGURE_SIZES = {1: (8.0, 4.4), 2: (8.0, 6.0)}
"""Size of a figure (inches) by its number of axes."""
PAPER_MARK: dict[str, Any] = {"color": Paint.ALARM, "marker": "D", "ls": "", "ms": 7, "mec": "white", "zorder": 5}
"""Mark of a number of the paper."""
RESPONSE_BAND = (1300.0, 2200.0)
"""Frequency range of Figs. 5 and 6 (Hz)."""
MAX_DEPTH_RATIO = 6.0
"""Largest depth drawn, in lowest limits of the new spindle."""


def _draw_modes(shaft: Axes, shapes: Axes, study: PaperStudy) -> None:
    spindle = study.plain.new.spindle
    draw_shaft(shaft, spindle)
    shaft.set(title="surrogate, to scale: not the paper's dimensions", xlabel="")
    draw_shapes(shapes, mode_shapes(spindle, 3, np.linspace(0.0, spindle.length, 400)))


def _draw_convergence(axes: Axes, study: PaperStudy) -> None:
    looks: tuple[tuple[ElementKind, str, str, str], ...] = (
        ("linear", "linear with shear (as BEAM188)", Paint.ALARM, "s"),
        ("timoshenko", "cubic with shear", Paint.NEWEST, "o"),
        ("euler-bernoulli", "cubic without shear", Paint.GOOD, "^"),
    )
    for kind, label, colour, mark in looks:
        error = np.array(study.meshes.frequencies[kind]) / study.meshes.exact[kind] - 1
        axes.loglog(ELEMENT_COUNTS, error, color=colour, marker=mark, label=label)
    paper = printed.FEM_FREQUENCY / printed.RIGID_FREQUENCY - 1
    axes.loglog(printed.FEM_ELEMENTS, paper, label="paper: FEM above DSM", **PAPER_MARK)
    axes.set(xlabel="number of elements", ylabel="relative error of f1 (-)")
    axes.legend(loc="lower left")


def _draw_response(axes: Axes, study: PaperStudy, part: str) -> None:
    tap = study.tap

    def values(receptance: Complexes) -> Floats:
        return (receptance.real if part == "Re" else receptance.imag) * 1e6

    label, surrogate = "mode with the paper's numbers", f"surrogate, {len(tap.surrogate_modes)} modes"
    axes.plot(tap.frf.frequency, values(tap.frf.receptance), color=Paint.NEWEST, lw=1.8, label=label)
    frequency, receptance = tap.surrogate_frf.frequency, tap.surrogate_frf.receptance
    axes.plot(frequency, values(receptance), color=Paint.FIRST, ls="--", label=surrogate)
    hits = tap.tapped.in_band(RESPONSE_BAND)
    axes.plot(
        hits.frequency, values(hits.receptance), ".", color=Paint.GOOD, ms=5, label="surrogate, ten emulated hits"
    )
    if part == "Re":
        for at, name in zip(tap.extremes, ("omega_A", "omega_B"), strict=True):
            _draw_mark(axes, tap.measured.receptance(np.array([at])).real[0] * 1e6, at, name)
    else:
        _draw_mark(axes, tap.depth * 1e6, tap.measured.frequency, "D")
    axes.axhline(0, color="black", lw=0.6)
    axes.set(xlabel="frequency (Hz)", ylabel=f"{part} G (µm/N)", xlim=RESPONSE_BAND)
    axes.legend(loc="lower left")


def _draw_mark(axes: Axes, height: float, frequency: float, name: str) -> None:
    axes.plot(frequency, height, color=Paint.ALARM, marker="o", ls="")
    text: dict[str, Any] = {"xytext": (10, 0), "textcoords": "offset points", "va": "center"}
    axes.annotate(f"{name}: {frequency:.1f} Hz, {height:.4f} µm/N", (frequency, height), **text)


def _draw_whirl(axes: Axes, study: PaperStudy, whirl: str, critical: float) -> None:
    plain, shear = (getattr(shaft, whirl) for shaft in (study.plain, study.shear))
    speed, label = plain.speed_rpm / 1e3, "rotating frame, as in the paper"
    axes.plot(speed, plain.rotating_forward[0], color=Paint.NEWEST, lw=1.8, label=label)
    axes.plot(speed, plain.forward[0], color=Paint.GOOD, lw=1.8, ls="--", label="fixed frame")
    label = "both with shear and gyroscopic moments"
    axes.plot(speed, shear.rotating_forward[0], color=Paint.NEWEST, lw=0.9, ls=":")
    axes.plot(speed, shear.forward[0], color=Paint.GOOD, lw=0.9, ls=":", label=label)
    axes.plot(speed, shear.backward[0], color=Paint.GOOD, lw=0.9, ls=":")
    axes.plot(speed, plain.speed_rpm / 60, color="black", lw=0.8, ls="-.", label="once per revolution")
    axes.plot(critical / 1e3, 0, label="critical speed in the paper", clip_on=False, **PAPER_MARK)
    axes.set(xlabel="spindle speed (1000 rpm)", ylabel="first frequency (Hz)")
    axes.set(xlim=(0, speed[-1]), ylim=(0, 1.65 * plain.forward[0, 0]))
    axes.legend(loc="upper left", ncols=2, fontsize=9)


def _draw_stiffness_curve(axes: Axes, study: PaperStudy) -> None:
    looks = (study.plain, "Euler-Bernoulli, as in the paper", "-"), (study.shear, "Timoshenko", "--")
    for shaft, name, dashes in looks:
        axes.semilogx(*shaft.curve, color=Paint.NEWEST, ls=dashes, label=f"surrogate, {name}")
        axes.axhline(shaft.rigid_frequency, color=Paint.FIRST, lw=0.8, ls=dashes)
    axes.annotate("rigid bearings", (1.2e7, study.plain.rigid_frequency + 25), color=Paint.FIRST, fontsize=9)
    points = (printed.BEARING_STIFFNESS, printed.OLD_BEARING_STIFFNESS), (printed.FREQUENCY, printed.OLD_FREQUENCY)
    axes.plot(*points, label="paper, new and old", **PAPER_MARK)
    axes.plot(1e13, printed.RIGID_FREQUENCY, label="paper, rigid", **(PAPER_MARK | {"marker": "s"}))
    axes.set(xlabel="stiffness of each bearing (N/m)", ylabel="first frequency (Hz)")
    axes.set(xlim=(1e7, 1.5e13), ylim=(0, 2600))
    axes.legend(loc="lower right")


def _draw_paper_lobes(axes: Axes, study: PaperStudy) -> None:
    lobes = study.lobes
    looks = (
        (lobes.new, "new: 1722 Hz", Paint.FIRST, "-"),
        (lobes.by_rule, "old, K x 0.9 as in the paper", Paint.ALARM, "-"),
        (lobes.by_model, "old, K of the model", Paint.NEWEST, "--"),
    )
    for chart, label, colour, dashes in looks:
        depth = np.minimum(chart.depth / lobes.new.minimum.depth, 2 * MAX_DEPTH_RATIO)
        axes.plot(chart.speed_rpm / 1e3, depth, color=colour, ls=dashes, lw=1.5, label=label)
    before, after = ((speed / 1e3, 5.2) for speed in lobes.pocket)
    axes.annotate("", after, before, arrowprops={"arrowstyle": "->", "color": "black", "lw": 1.2})
    axes.set(xlabel="spindle speed (1000 rpm)", ylabel="limit depth / lowest limit, new (-)")
    axes.set(xlim=(lobes.new.speed_rpm[0] / 1e3, lobes.new.speed_rpm[-1] / 1e3), ylim=(0, MAX_DEPTH_RATIO))
    axes.legend(loc="upper left")


class PaperFigure(NamedTuple):
    """Figure of the page."""

    caption: str
    """Caption of the figure."""
    draw: Callable[..., None]
    """Function that draws it from axes and the study."""
    options: tuple[Any, ...] = ()
    """Further arguments of the function."""
    rows: int = 1
    """Number of axes, one above the other."""


RIGID_WHIRL, WHIRL = ("rigid_whirl", printed.RIGID_CRITICAL_SPEED), ("whirl", printed.CRITICAL_SPEED)
PAPER_FIGURES: Mapping[str, PaperFigure] = {
    "fig-3": PaperFigure("Fig. 3: surrogate with ten bearings, and its first modes", _draw_modes, (), 2),
    "fig-8": PaperFigure("Fig. 8: first frequency over stiffness of each bearing", _draw_stiffness_curve),
    "convergence": PaperFigure("Finite elements compared with the exact first frequency", _draw_convergence),
    "fig-7": PaperFigure("Fig. 7: first frequency over speed, rigid bearings", _draw_whirl, RIGID_WHIRL),
    "fig-9": PaperFigure("Fig. 9: first frequency over speed, bearings calibrated to 1722 Hz", _draw_whirl, WHIRL),
    "fig-5": PaperFigure("Fig. 5: real part of the receptance at the tool tip", _draw_response, ("Re",)),
    "fig-6": PaperFigure("Fig. 6: imaginary part of the receptance at the tool tip", _draw_response, ("Im",)),
    "fig-10": PaperFigure("Fig. 10: stability lobes, new and after a drop of f1 by 10 %", _draw_paper_lobes),
}
"""Figures 3 and 5 to 10, and the convergence of the finite elements, by file name."""


def render_paper_page(study: PaperStudy) -> str:
    """Return the page in Markdown."""
    template = resources.files("lobewatch.show.paper").joinpath("paper.md").read_text(encoding="utf-8")
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    return environment.from_string(template).render(study=study, cells=paper_cells, figures=PAPER_FIGURES)


def write_paper_page(study: PaperStudy, folder: Path) -> Path:
    """Write the page, and its figures in `images`, into a folder, made if missing; DataError for a file."""
    if folder.exists() and not folder.is_dir():
        raise DataError(f"{folder}: not a folder. Name a folder with --out.")
    make_folder(folder / "images")
    for name, picture in PAPER_FIGURES.items():
        figure, axes = new_axes(picture.rows, PAPER_FIGURE_SIZES[picture.rows])
        picture.draw(*axes, study, *picture.options)
        save_figure(figure, folder / "images" / f"paper-{name}.png")
    page = folder / "paper.md"
    atomic_write(page, render_paper_page(study).encode())
    return page
