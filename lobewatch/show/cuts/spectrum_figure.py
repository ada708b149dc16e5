"""Plot the spectrum of recorded cuts."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from lobewatch.cuts.chatter_detection.cut_evaluation import group_peaks
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.show.cuts.recorded_cuts import cut_verdict_label
from lobewatch.show.figures.drawing import Paint, new_axes, save_figure
from lobewatch.tap.cut_recording import MAX_CURVE_FREQUENCY

LINE_KIND_MARKS = {
    "turns": ("spindle harmonics", Paint.FIRST, "|"),
    "tooth": ("tooth passing", Paint.NEWEST, "o"),
    "air": ("also in air", Paint.EVENT, "x"),
    "chatter": ("chatter", Paint.ALARM, "D"),
}
"""Label, grey-safe mark and paint of each kind of spectral line."""
MIN_SHOWN_AMPLITUDE = 1e-4
"""Smallest amplitude drawn, as a share of the largest."""


def save_cut_spectrum(comparisons: Sequence[CutComparison], path: Path) -> None:
    """Plot amplitude over frequency to a file, a panel for each cut; only its title without a spectrum."""
    figure, axes = new_axes(len(comparisons), (10.0, 4.5 * len(comparisons)))
    for axis, comparison in zip(axes, comparisons, strict=True):
        _draw_spectrum(axis, comparison)
    save_figure(figure, path)


def _draw_spectrum(axis: Axes, comparison: CutComparison) -> None:
    spectrum = comparison.detected.spectrum
    setting = comparison.setting
    depth = f", {LENGTH.text(1e3 * setting.depth, '.3g')}" if math.isfinite(setting.depth) else ""
    named = f"{setting.program or 'reference cut'}, {comparison.speed_rpm:.0f} rpm{depth}"
    axis.set_title(f"{named}: {cut_verdict_label(comparison)}", loc="left", fontsize=11, fontweight="bold")
    axis.set(xlabel="frequency (Hz)", ylabel="amplitude (m/s²)")
    if spectrum is None:
        return
    inside = spectrum.frequency <= min(MAX_CURVE_FREQUENCY, spectrum.sample_rate / 2)
    amplitude = np.sqrt(spectrum.power[inside])
    axis.semilogy(spectrum.frequency[inside], amplitude, color="#bbbbbb", lw=0.6)
    for name, lines in group_peaks(comparison.detected).items():
        label, colour, mark = LINE_KIND_MARKS[name]
        axis.plot(lines.frequency, lines.amplitude, mark, color=colour, ms=5, label=label, fillstyle="none")
    tool = comparison.assembly
    for direction, modes, dashes in () if tool is None else (("x", tool.x, ":"), ("y", tool.y, "--")):
        label = f"modes in {direction} (not rotating)"
        for mode in modes or ():
            axis.axvline(mode.frequency, color=Paint.GOOD, ls=dashes, lw=1, label=label)
            label = ""
    top = float(np.max(amplitude))
    axis.set(xlim=(0, spectrum.frequency[inside][-1]), ylim=(MIN_SHOWN_AMPLITUDE * top, 3 * top))
    axis.legend(loc="upper right", ncols=3, fontsize=8)
