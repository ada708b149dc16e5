"""The spectrum of a cut: lines of the spindle, chatter, what was there before, the modes of the tool."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lobewatch.cuts.listening.judge_cut import line_kinds
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.cuts.describe_listened import listened_text
from lobewatch.show.figures.style import ALARM, EVENT, GOOD, NOW, THEN, new_axes, save_figure
from lobewatch.tap.listening.cut_state import HIGHEST
from lobewatch.tool.assembly import Assembly

MARKS = {
    "turns": ("turns of the spindle", THEN, "|"),
    "tooth": ("tooth passing", NOW, "o"),
    "air": ("there in air", EVENT, "x"),
    "chatter": ("chatter", ALARM, "D"),
}
"""Label, colour and mark of lines."""
SHOWN = 1e-4
"""Share of the loudest amplitude down to which is drawn."""


def save_listened(comparisons: Sequence[CutComparison], path: Path) -> None:
    """Write the picture of the cuts in a recording to a file."""
    save_figure(listened_figure(comparisons), path)


def listened_figure(comparisons: Sequence[CutComparison]) -> Figure:
    """Amplitude over frequency, a panel for each cut; the word alone where it did not get as far as a spectrum."""
    figure, axes = new_axes(len(comparisons), (10.0, 4.5 * len(comparisons)))
    for axis, comparison in zip(axes, comparisons, strict=True):
        _draw(axis, comparison)
    return figure


def _draw(axis: Axes, comparison: CutComparison) -> None:
    """One cut."""
    spectrum = comparison.heard.spectrum
    setting = comparison.setting
    named = f"{setting.program or 'reference cut'}, {comparison.speed_rpm:.0f} rpm, {1e3 * setting.depth:.3g} mm"
    word = listened_text(comparison).partition(":")[0]
    axis.set_title(f"{named}: {word}", loc="left", fontsize=11, fontweight="bold")
    axis.set(xlabel="frequency (Hz)", ylabel="amplitude (m/s²)")
    if spectrum is None:
        return
    inside = spectrum.frequency <= min(HIGHEST, spectrum.sample_rate / 2)
    amplitude = np.sqrt(spectrum.power[inside])
    axis.semilogy(spectrum.frequency[inside], amplitude, color="#bbbbbb", lw=0.6)
    for name, lines in line_kinds(comparison.heard).items():
        label, colour, mark = MARKS[name]
        axis.plot(lines.frequency, lines.amplitude, mark, color=colour, ms=5, label=label, fillstyle="none")
    if comparison.assembly is not None:
        _modes(axis, comparison.assembly)
    top = float(np.max(amplitude))
    axis.set(xlim=(0, spectrum.frequency[inside][-1]), ylim=(SHOWN * top, 3 * top))
    axis.legend(loc="upper right", ncols=3, fontsize=8)


def _modes(axis: Axes, assembly: Assembly) -> None:
    """Modes of the tool as it was tapped."""
    for name, modes, dashes in (("x", assembly.x, ":"), ("y", assembly.y, "--")):
        for number, mode in enumerate(modes or ()):
            label = f"modes in {name}, at rest" if number == 0 else None
            axis.axvline(mode.frequency, color=GOOD, ls=dashes, lw=1, label=label)
