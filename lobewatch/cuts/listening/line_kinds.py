"""The lines of a cut by what they are, as every picture of it marks them."""

from __future__ import annotations

from lobewatch.cuts.listening.listen_to import CutSound
from lobewatch.cuts.listening.spectrum import SpectralLines


def line_kinds(heard: CutSound) -> dict[str, SpectralLines]:
    """Lines that are there, under "turns" of the spindle, "tooth" passing, "air" (there without a cut), "chatter"."""
    lines, chatter = heard.lines, heard.chatter
    named: dict[str, SpectralLines] = {}
    if lines is not None:
        tooth = lines.tooth == 0
        named = {"turns": lines.comb[~tooth], "tooth": lines.comb[tooth], "air": lines.foreign}
    if chatter is not None:
        named["chatter"] = chatter.lines
    return {name: one for name, one in named.items() if len(one)}
