"""Pockets whose depths only test cuts tell, for people and as JSON."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import Remark, joined
from lobewatch.cuts.learning.heard_depth import CUTS, HeardDepth
from lobewatch.machine import ProgramTable
from lobewatch.show.programs.describe_advice import rpm
from lobewatch.show.terminal.output import remark_json, remark_lines, table
from lobewatch.verdicts.speed_pockets import MOST_GAIN, SpeedPocket


def pocket_json(pocket: SpeedPocket) -> dict[str, Any]:
    """One pocket; its depth is not known."""
    return {
        "speed_rpm": pocket.speed_rpm,
        "window_rpm": pocket.window_rpm,
        "depth_mm": None,
        "over_lowest_limit": pocket.gain,
    }


def speed_table(pockets: Sequence[SpeedPocket]) -> Table:
    """Pockets, a line each."""
    rows = table("speed (rpm)", "window (rpm)", "over the lowest limit")
    for pocket in pockets:
        low, high = pocket.window_rpm
        gain = f"{pocket.gain:.1f} times" if pocket.gain < MOST_GAIN else f"{MOST_GAIN:g} times or more"
        rows.add_row(rpm(round(pocket.speed_rpm)), f"{rpm(math.ceil(low))}..{rpm(math.floor(high))}", gain)
    return rows


def speeds_json(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> dict[str, Any]:
    """The pockets of a cut, and why no depth is known."""
    return {
        "cut": cut,
        "pockets": [pocket_json(pocket) for pocket in pockets],
        "remarks": [remark_json(remark) for remark in joined(remarks)],
    }


def speeds_texts(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> list[str | Table]:
    """The same for people."""
    heading = f"{cut}: pockets by frequency and damping, the largest removal rate first; how deep, test cuts tell"
    return [heading, speed_table(pockets), *remark_lines(remarks)]


def heard_json(program: ProgramTable, depths: Sequence[HeardDepth], first: float) -> dict[str, Any]:
    """The next cut, and what was heard in each pocket."""
    following = _next(depths, first)
    return {
        "program": program.name,
        "suggested": None if following is None else {"speed_rpm": following[0], "depth_mm": _mm(following[1])},
        "pockets": [
            pocket_json(heard.pocket)
            | {
                "cut_at_rpm": heard.speed_rpm,
                "cuts": [cut.id for cut in heard.cuts],
                "heard_stable_mm": _mm(heard.depth) if heard.depth else None,
                "heard_chatter_mm": _mm(heard.chatters_at) if math.isfinite(heard.chatters_at) else None,
            }
            for heard in depths
        ],
    }


def heard_lines(program: ProgramTable, depths: Sequence[HeardDepth], first: float, folder: Path) -> Iterator[str]:
    """The next cut, and the depths that were heard stable."""
    following = _next(depths, first)
    if following is not None:
        speed, depth = following
        made = len(depths[0].cuts)
        number = f"test cut {made + 1} of at most {CUTS} in the pocket nearest to it"
        yield f"{program.name}: {number}: {rpm(speed)} rpm, {_mm(depth):g} mm"
        observe = shlex.join(["lobewatch", "observe", str(folder), "--program", program.name])
        yield f"then: {observe} --speed {speed:g} --depth {_mm(depth):g} --stable (or --chatter --frequency HZ)"
    for heard in depths:
        if heard.depth:
            above = f", chatter at {_mm(heard.chatters_at):g} mm" if math.isfinite(heard.chatters_at) else ""
            count = len(heard.cuts)
            cuts = f"{count} cut{'s' if count > 1 else ''}"
            yield f"recommended by {cuts}: {_mm(heard.depth):g} mm at {rpm(heard.speed_rpm)} rpm, heard stable{above}"
    if not any(heard.depth for heard in depths):
        yield "no depth is recommended yet: none was heard stable in a pocket"


def _next(depths: Sequence[HeardDepth], first: float) -> tuple[float, float] | None:
    """Speed (rpm) and depth (m) of the next cut, in the pocket nearest to the program; None where all is heard."""
    wanted = depths[0].next_depth(first) if depths else None
    return None if wanted is None else (depths[0].speed_rpm, wanted)


def _mm(depth: float) -> float:
    return round(1e3 * depth, 4)
