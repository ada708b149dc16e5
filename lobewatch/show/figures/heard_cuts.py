"""Test cuts in a stability lobe diagram: where they were made, and what they sounded like."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes

from lobes import Cut
from lobewatch.machine.journal.heard_cut import HeardCut, geometry
from lobewatch.show.figures.labels import PictureLabels
from lobewatch.show.figures.style import ALARM, GOOD

MARKS = {False: ("heard stable", GOOD, "o"), True: ("heard to chatter", ALARM, "x")}
"""Name, colour and mark of cuts by whether they chatter; wide and hollow, so that a program's own shows through."""
SIZE = 11.0
"""Of a mark (points)."""


def heard_of(cuts: Sequence[HeardCut], name: str, tool: str, cut: Cut) -> list[HeardCut]:
    """Those with this tool, cutter and immersion that count: of the cut of this name, or of the same coefficients."""
    known = [one for one in cuts if one.counts and one.tool == tool and geometry(one.cut) == geometry(cut)]
    force = cut.tangential, cut.radial
    return [one for one in known if one.program == name or (one.cut.tangential, one.cut.radial) == force]


def draw_heard(axes: Axes, cuts: Sequence[HeardCut], labels: PictureLabels) -> None:
    """A mark for each cut, with the frequency that it chattered at; before other words look for a place."""
    for chatters, (name, colour, mark) in MARKS.items():
        some = [cut for cut in cuts if cut.chatters == chatters]
        if some:
            places = [cut.speed_rpm for cut in some], [1e3 * cut.depth for cut in some]
            axes.plot(*places, mark, color=colour, mfc="none", ms=SIZE, mew=2.2, zorder=4, label=name)
    for cut in cuts:
        labels.keep_clear((cut.speed_rpm, 1e3 * cut.depth), SIZE)
    for cut in cuts:
        if cut.chatter_frequency_hz is not None:
            labels.add(f"{cut.chatter_frequency_hz:.0f} Hz", (cut.speed_rpm, 1e3 * cut.depth), ALARM)
