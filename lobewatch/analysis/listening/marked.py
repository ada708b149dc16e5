"""The lines of a cut by what they are, as every picture of it marks them."""

from __future__ import annotations

from lobewatch.analysis.listening.heard_cut import ListenedCut
from lobewatch.analysis.listening.spectrum import Lines


def marked(found: ListenedCut) -> dict[str, Lines]:
    """Lines that are there, under "turns" of the spindle, "tooth" passing, "air" (there without a cut), "chatter"."""
    lines, chatter = found.heard.lines, found.heard.chatter
    named: dict[str, Lines] = {}
    if lines is not None:
        tooth = lines.tooth == 0
        named = {"turns": lines.comb[~tooth], "tooth": lines.comb[tooth], "air": lines.foreign}
    if chatter is not None:
        named["chatter"] = chatter.lines
    return {name: one for name, one in named.items() if len(one)}
