"""The next test cut, for people and as JSON."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lobewatch.cuts.learning.of_program import NextCut
from lobewatch.cuts.learning.suggest import Suggestion
from lobewatch.show.cuts.describe_learnt import learnt_json
from lobewatch.show.programs.names import NAMES
from lobewatch.show.programs.settings import rpm


def suggestion_json(found: NextCut) -> dict[str, Any]:
    """The cut, and what it rests on."""
    cut, best = found.suggested, _best(found)
    return {
        "program": found.lesson.program.name,
        "suggested": None if cut is None else _cut_json(cut),
        "cuts_made": len(found.lesson.own),
        "cuts_left": found.left,
        "best_heard": None if best is None else {"speed_rpm": best[0], "depth_mm": 1e3 * best[1]},
        "learnt": learnt_json(found.lesson),
    }


def _cut_json(cut: Suggestion) -> dict[str, Any]:
    return {
        "speed_rpm": cut.speed_rpm,
        "depth_mm": round(1e3 * cut.depth, 6),
        "chance_of_chatter": cut.chance,
        "expected_gain": cut.gain,
        "settles": cut.settles,
    }


def suggestion_lines(found: NextCut, folder: Path) -> Iterator[str]:
    """A line for each thing a person needs."""
    name, cut, made = found.lesson.program.name, found.suggested, len(found.lesson.own)
    if cut is None:
        yield f"{name}: {_why_none(found)}"
    else:
        depth = f"{1e3 * cut.depth:.4g}"
        yield (
            f"{name}: test cut {made + 1} of {made + found.left}: {rpm(cut.speed_rpm)} rpm, {depth} mm, "
            f"chance of chatter {round(100 * cut.chance)} %; it tells most of {NAMES[cut.settles]}"
        )
        said = shlex.join(["lobewatch", "observe", str(folder), "--program", name])
        yield f"then: {said} --speed {cut.speed_rpm:g} --depth {depth} --stable (or --chatter --frequency HZ)"
    best = _best(found)
    if best is not None:
        gain = f"; the next is expected to gain {100 * cut.gain:.0f} %" if cut and math.isfinite(cut.gain) else ""
        yield f"most chips heard stable: {1e3 * best[1]:.4g} mm at {rpm(best[0])} rpm{gain}"
    yield "a test cut is no advice: lobewatch check says what may be run"


def _why_none(found: NextCut) -> str:
    if not found.left:
        return f"{len(found.lesson.own)} test cuts are made; a larger --cuts asks for more"
    return "no test cut is worth making: nothing more is to be gained"


def _best(found: NextCut) -> tuple[float, float] | None:
    """Speed (rpm) and depth (m) of most chips that were heard stable; None where none was."""
    stable = [(cut.speed_rpm, cut.depth) for cut in found.lesson.own if not cut.chatters]
    return max(stable, key=lambda one: one[0] * one[1], default=None)
