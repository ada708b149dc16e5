"""The picture of a modal extraction: FRF with fit and residual, stabilisation chart, Nyquist circles."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.ticker import MaxNLocator, MultipleLocator
from numpy.typing import NDArray

from dsm import plus_minus
from lobewatch.show.figures.style import ALARM, NOW, STYLE, THEN
from modal import Extraction, FittedBand, Mode, Trust, candidates, survey, trust_of

COLUMNS = 4
"""Circles in a row."""
MOST_CIRCLES = 8
"""Circles at most: of more modes those that are believed most and have the highest peaks of accelerance are drawn."""
LEAST_APART = 0.014
"""Between labels of modes that are close (share of the axis)."""
LEGEND = 0.08
"""Room for it below all lines (share of the axis)."""
HIGHEST = 10.5
"""Just above the poles of the highest order."""
REACH = 3.0
"""A circle is drawn over this many half-power half-widths on either side."""


MARKS = {Trust.TRUSTED: "", Trust.DOUBTFUL: " ?", Trust.REJECTED: " -"}
"""Mark behind the frequency of a mode."""


def modes_figure(state: Extraction, modes: Sequence[Mode], title: str) -> Figure:
    """|Accelerance| measured, fitted and what is left; LSCF poles of every order, with those named that are stable but
    no modes; circle and phase of each mode. Of free decays the spectrum of the first one, and no circles."""
    circles = sorted((mode for mode in modes if mode.has_stiffness), key=_rank)[:MOST_CIRCLES]
    rows = -(-len(circles) // COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 6.0 + 2.4 * rows), layout="constrained")
        grid = figure.add_gridspec(2 + rows, COLUMNS, height_ratios=[3.2, 2.2, *rows * [2.4]])
        top = figure.add_subplot(grid[0, :])
        chart = figure.add_subplot(grid[1, :], sharex=top)
        _draw_frf(top, state, modes)
        _draw_chart(chart, state, modes)
        _draw_circles(figure, grid, state, sorted(circles, key=lambda mode: mode.frequency))
    top.set_title(title, pad=10 + 6 * max((len(_name(mode)) for mode in modes), default=0))
    return figure


def _rank(mode: Mode) -> tuple[int, float]:
    """Trusted modes first, of those the one with the highest peak."""
    return list(Trust).index(trust_of(mode)), -(mode.frequency**2) * mode.peak


def _draw_frf(axes: Axes, state: Extraction, modes: Sequence[Mode]) -> None:
    f = state.frf.frequency
    axes.semilogy(f, np.abs(state.frf.accelerance), color=THEN, lw=0.8, label="measured")
    for i, band in enumerate(state.bands):
        part = f[band.lines]
        size = (2 * np.pi * part) ** 2
        left = state.left(band)[0]
        fitted = state.frf.receptance[band.lines] - left
        axes.semilogy(part, np.abs(fitted) * size, color=NOW, ls="--", label="fit in its bands" if i == 0 else None)
        axes.semilogy(part, np.abs(left) * size, color=ALARM, lw=0.6, label="measured - fit" if i == 0 else None)
    places = _apart([mode.frequency for mode in modes], LEAST_APART * (f[-1] - f[0]))
    for mode, place in zip(modes, places, strict=True):
        axes.annotate(
            _name(mode),
            (place, 1.0),
            xytext=(0, 2),
            textcoords="offset points",
            xycoords=("data", "axes fraction"),
            rotation=90,
            ha="center",
            va="bottom",
            fontsize=8,
        )
    low, high = axes.get_ylim()
    is_frf = all(mode.has_stiffness for mode in modes)
    axes.set_ylabel("|accelerance| (m/s²/N)" if is_frf else "|spectrum of a decay| (m/s)")
    axes.set(xlim=(f[0], f[-1]), ylim=(low * (low / high) ** LEGEND, high))
    axes.tick_params(labelbottom=False)
    axes.legend(loc="lower right", ncols=3)


def _name(mode: Mode) -> str:
    return f"{_hertz(mode.frequency)}{MARKS[trust_of(mode)]}"


def _hertz(frequency: float) -> str:
    return f"{frequency:.0f}" if frequency >= 100 else f"{frequency:.3g}"


def _apart(places: Sequence[float], least: float) -> list[float]:
    """Rising places, each moved up as far as it must be to stand this far from the one before."""
    moved: list[float] = []
    for place in places:
        moved.append(max(place, moved[-1] + least) if moved else place)
    return moved


def _draw_chart(axes: Axes, state: Extraction, modes: Sequence[Mode]) -> None:
    for band in state.bands:
        axes.axvspan(*state.frf.frequency[band.lines][[0, -1]], color=THEN, alpha=0.10, lw=0)
        chart = band.data.chart
        axes.plot(chart.frequency[~chart.stable], chart.order[~chart.stable], "x", color=THEN, ms=3)
    for chart in survey(state):
        axes.plot(chart.frequency[chart.stable], chart.order[chart.stable], "o", color=NOW, ms=3)
    axes.plot([], [], "x", color=THEN, ms=3, label="pole (in the bands)")
    axes.plot([], [], "o", color=NOW, ms=3, label="stable pole")
    for mode in modes:
        axes.axvline(mode.frequency, color=NOW, lw=0.6)
    others = candidates(state)
    for frequency, place in zip(others, _apart(others.tolist(), LEAST_APART * np.ptp(axes.get_xlim())), strict=True):
        axes.annotate(_hertz(frequency), (place, HIGHEST), rotation=90, ha="center", va="bottom", fontsize=7, color=NOW)
    axes.set(xlabel="frequency (Hz); grey: the bands fitted; ?: doubtful, -: rejected; blue: no mode yet")
    axes.set(ylabel="order", ylim=(0, HIGHEST + 3))
    axes.yaxis.set_major_locator(MultipleLocator(2))
    axes.legend(loc="lower right", ncols=2, frameon=True, framealpha=0.9, edgecolor="none")


def _draw_circles(figure: Figure, grid: GridSpec, state: Extraction, modes: Sequence[Mode]) -> None:
    for k, mode in enumerate(modes):
        axes = figure.add_subplot(grid[2 + k // COLUMNS, k % COLUMNS])
        band = min(state.bands, key=lambda band: float(np.min(np.abs(band.fit.frequency - mode.frequency))))
        _draw_circle(axes, state, band, mode)


def _draw_circle(axes: Axes, state: Extraction, band: FittedBand, mode: Mode) -> None:
    """Mobility of the mode over its resonance: lines measured, with all that is fitted beside it taken off; the fit.

    The line from the origin to the natural frequency has the angle of the modal constant: 0 degrees for a real mode of
    a driving point.
    """
    f = state.frf.frequency[band.lines]
    reach = REACH * mode.damping_ratio * mode.frequency
    near = np.abs(f - mode.frequency) < reach
    fine = np.linspace(mode.frequency - reach, mode.frequency + reach, 300)
    points = _mobility(f, mode.receptance(f) + state.left(band)[0])[near]
    curve = _mobility(fine, mode.receptance(fine))
    top = complex(np.exp(1j * np.angle(mode.constant)) * np.max(np.abs(curve)))
    axes.axhline(0.0, color=THEN, lw=0.5)
    axes.plot(points.real, points.imag, ".", color=THEN, ms=4, label="measured")
    axes.plot(curve.real, curve.imag, color=NOW, lw=1, label="fit")
    axes.plot([0.0, top.real], [0.0, top.imag], color=ALARM, lw=1, label="phase")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"{_hertz(mode.frequency)} Hz{MARKS[trust_of(mode)]}: {_phase(mode)}\nmobility (mm/s/N)", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.yaxis.set_major_locator(MaxNLocator(4))


def _mobility(frequency: NDArray[np.float64], receptance: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Mobility (mm/s/N)."""
    return np.asarray(2j * np.pi * 1e3 * frequency * receptance)


def _phase(mode: Mode) -> str:
    """Phase of the modal constant against that of a real mode, with its error."""
    if not mode.phase_deg:
        return "real"
    return f"phase {plus_minus(mode.phase_deg, mode.phase_deg_std or None)}°"
