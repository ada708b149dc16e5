"""Show the next test cut to make and what test cuts have taught."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import Remark, merge_remarks
from lobewatch.cuts.learning.label_check import inconsistent_cut_remarks
from lobewatch.cuts.learning.pocket_depth import MAX_POCKET_CUTS, PocketDepth
from lobewatch.cuts.learning.posterior import Interval
from lobewatch.cuts.learning.program_learning import LearningResult, NextCut
from lobewatch.cuts.learning.suggestion import Suggestion
from lobewatch.machine import ProgramTable
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.verdicts import factor_text
from lobewatch.show.terminal.output import new_table, remark_json, remark_lines
from lobewatch.verdicts.speed_pockets import MAX_POCKET_GAIN, SpeedPocket


def speed_pocket_json(pocket: SpeedPocket) -> dict[str, Any]:
    """One pocket; its depth is not known."""
    return {
        "speed_rpm": pocket.speed_rpm,
        "window_rpm": pocket.window_rpm,
        "depth_mm": None,
        "over_lowest_limit": pocket.gain,
    }


def speed_pocket_table(pockets: Sequence[SpeedPocket]) -> Table:
    """Pockets, a line each."""
    rows = new_table("speed (rpm)", "window (rpm)", "over the lowest limit")
    for pocket in pockets:
        low, high = pocket.window_rpm
        gain = f"{pocket.gain:.1f} times" if pocket.gain < MAX_POCKET_GAIN else f"{MAX_POCKET_GAIN:g} times or more"
        rows.add_row(
            format_rpm(round(pocket.speed_rpm)), f"{format_rpm(math.ceil(low))}..{format_rpm(math.floor(high))}", gain
        )
    return rows


def speed_pockets_json(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> dict[str, Any]:
    """The pockets of a cut, and why no depth is known."""
    return {
        "cut": cut,
        "pockets": [speed_pocket_json(pocket) for pocket in pockets],
        "remarks": [remark_json(remark) for remark in merge_remarks(remarks)],
    }


def speed_pockets_texts(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> list[str | Table]:
    """The same for people."""
    heading = f"{cut}: pockets by frequency and damping, the largest removal rate first; how deep, test cuts tell"
    return [heading, speed_pocket_table(pockets), *remark_lines(remarks)]


def tried_depths_json(program: ProgramTable, depths: Sequence[PocketDepth], first: float) -> dict[str, Any]:
    """The next cut, and what was heard in each pocket."""
    following = _next_depth(depths, first)
    return {
        "program": program.name,
        "suggested": None if following is None else {"speed_rpm": following[0], "depth_mm": _round_to_mm(following[1])},
        "pockets": [
            speed_pocket_json(heard.pocket)
            | {
                "cut_at_rpm": heard.speed_rpm,
                "cuts": [cut.id for cut in heard.cuts],
                "heard_stable_mm": _round_to_mm(heard.stable_depth) if heard.stable_depth else None,
                "heard_chatter_mm": _round_to_mm(heard.chatter_depth) if math.isfinite(heard.chatter_depth) else None,
            }
            for heard in depths
        ],
    }


def tried_depths_lines(
    program: ProgramTable, depths: Sequence[PocketDepth], first: float, folder: Path
) -> Iterator[str]:
    """The next cut, and the depths that were heard stable."""
    following = _next_depth(depths, first)
    if following is not None:
        speed, depth = following
        made = len(depths[0].cuts)
        number = f"test cut {made + 1} of at most {MAX_POCKET_CUTS} in the pocket nearest to it"
        yield f"{program.name}: {number}: {format_rpm(speed)} rpm, {_round_to_mm(depth):g} mm"
        observe = shlex.join(["lobewatch", "observe", str(folder), "--program", program.name])
        yield f"then: {observe} --speed {speed:g} --depth {_round_to_mm(depth):g} --stable (or --chatter --frequency HZ)"
    for heard in depths:
        if heard.stable_depth:
            above = (
                f", chatter at {_round_to_mm(heard.chatter_depth):g} mm" if math.isfinite(heard.chatter_depth) else ""
            )
            count = len(heard.cuts)
            cuts = f"{count} cut{'s' if count > 1 else ''}"
            yield f"recommended by {cuts}: {_round_to_mm(heard.stable_depth):g} mm at {format_rpm(heard.speed_rpm)} rpm, heard stable{above}"
    if not any(heard.stable_depth for heard in depths):
        yield "no depth is recommended yet: none was heard stable in a pocket"


def _next_depth(depths: Sequence[PocketDepth], first: float) -> tuple[float, float] | None:
    """Speed (rpm) and depth (m) of the next cut, in the pocket nearest to the program; None where all is heard."""
    wanted = depths[0].next_depth(first) if depths else None
    return None if wanted is None else (depths[0].speed_rpm, wanted)


def _round_to_mm(depth: float) -> float:
    return round(1e3 * depth, 4)


def suggestion_json(next_cut: NextCut) -> dict[str, Any]:
    """The cut, and what it rests on."""
    cut, best = next_cut.suggestion, _best_stable_cut(next_cut)
    return {
        "program": next_cut.learning.program.name,
        "suggested": None if cut is None else _suggested_cut_json(cut),
        "cuts_made": len(next_cut.learning.own_cuts),
        "cuts_left": next_cut.cuts_left,
        "best_heard": None if best is None else {"speed_rpm": best[0], "depth_mm": 1e3 * best[1]},
        "learnt": learned_json(next_cut.learning),
    }


def _suggested_cut_json(cut: Suggestion) -> dict[str, Any]:
    return {
        "speed_rpm": cut.speed_rpm,
        "depth_mm": round(1e3 * cut.depth, 6),
        "chance_of_chatter": cut.chatter_probability,
        "expected_gain": cut.gain,
        "settles": cut.most_informative,
        "repeats": cut.repeats or None,
    }


def suggestion_lines(next_cut: NextCut, folder: Path) -> Iterator[str]:
    """A line for each thing a person needs."""
    name, cut, n_made = next_cut.learning.program.name, next_cut.suggestion, len(next_cut.learning.own_cuts)
    if cut is None:
        yield f"{name}: {_no_suggestion_text(next_cut)}"
    else:
        depth = f"{1e3 * cut.depth:.4g}"
        yield (
            f"{name}: test cut {n_made + 1} of {n_made + next_cut.cuts_left}: {format_rpm(cut.speed_rpm)} rpm, {depth} mm, "
            f"chance of chatter {round(100 * cut.chatter_probability)} %; {_suggestion_reason(cut, next_cut.learning)}"
        )
        observe = shlex.join(["lobewatch", "observe", str(folder), "--program", name])
        power = (
            "" if next_cut.learning.program.feed_per_tooth_mm is None else "; --power KW, where it is shown, tells Kt"
        )
        yield f"then: {observe} --speed {cut.speed_rpm:g} --depth {depth} --stable (or --chatter --frequency HZ){power}"
    best = _best_stable_cut(next_cut)
    if best is not None:
        gain = f"; the next is expected to gain {100 * cut.gain:.0f} %" if cut and math.isfinite(cut.gain) else ""
        yield f"most chips heard stable: {1e3 * best[1]:.4g} mm at {format_rpm(best[0])} rpm{gain}"
    yield "a test cut is no advice: lobewatch check says what may be run"


def _suggestion_reason(cut: Suggestion, lesson: LearningResult) -> str:
    if cut.repeats:
        is_believed = cut.repeats in [made.id for made in lesson.accepted_cuts]
        return f"{cut.repeats} once more, since {'its word may be wrong' if is_believed else 'it is not believed'}"
    return f"it tells most of {factor_text(cut.most_informative)}"


def _no_suggestion_text(next_cut: NextCut) -> str:
    if not next_cut.cuts_left:
        return f"{len(next_cut.learning.own_cuts)} test cuts are made; a larger --cuts asks for more"
    if next_cut.cut_range.is_empty:
        return f"no test cut: {next_cut.cut_range.text}; choose another tool"
    return "no test cut is worth making: nothing more is to be gained"


def _best_stable_cut(next_cut: NextCut) -> tuple[float, float] | None:
    """Speed (rpm) and depth (m) of most chips that were heard stable; None where none was."""
    lesson = next_cut.learning
    believed = [cut for cut in lesson.own_cuts if cut not in lesson.rejected_cuts]
    stable = [(cut.speed_rpm, cut.depth) for cut in believed if not cut.has_chatter]
    return max(stable, key=lambda setting: setting[0] * setting[1], default=None)


def learned_json(lesson: LearningResult) -> dict[str, Any]:
    """Factors on what was tapped at rest (Kt, Kr/Kt: on what machine.toml says), with and without the cuts."""
    before, now = lesson.prior.intervals, lesson.posterior.intervals
    return {
        "cuts": [cut.id for cut in lesson.accepted_cuts],
        "chatter_frequencies": lesson.posterior.n_frequencies,
        "frequency_learnt": lesson.posterior.n_frequencies > 0,
        "effective_sample_size": lesson.posterior.effective_size,
        "factors": {name: _interval_json(now[name]) | {"before": _interval_json(before[name])} for name in now},
    }


def _interval_json(interval: Interval) -> dict[str, float]:
    return {"mean": interval.mean, "low": interval.low, "high": interval.high, "std": interval.std}


def learned_texts(lesson: LearningResult) -> list[str | Table]:
    """What the cuts have taught; nothing where there are none."""
    count = len(lesson.accepted_cuts)
    return [f"learnt from {count} cut{'s' if count > 1 else ''}:", learned_table(lesson)] if count else []


def learned_table(lesson: LearningResult) -> Table:
    """Factors, a line each: before the cuts, and now."""
    rows = new_table("~at speed, over at rest", "before (95 %)", "learnt (95 %)")
    before, now = lesson.prior.intervals, lesson.posterior.intervals
    for name in now:
        is_open = name.startswith("frequency") and not lesson.posterior.n_frequencies
        rows.add_row(
            factor_text(name), _interval_text(before[name]), "not learnt" if is_open else _interval_text(now[name])
        )
    return rows


def _interval_text(interval: Interval) -> str:
    return f"{interval.mean:.3f} ({interval.low:.3f}..{interval.high:.3f})"


def learned_remarks(lesson: LearningResult) -> Iterator[Remark]:
    """What was left out, and what the cuts say nothing of."""
    yield from inconsistent_cut_remarks(lesson.posterior, lesson.inconsistent_cuts, lesson.program.name)
    if lesson.accepted_cuts and not lesson.posterior.n_frequencies:
        text = "f not learnt: no chatter frequency was heard yet"
        yield Remark("frequency-not-learnt", lesson.program.name, text, "tell what the next chatter sounds at")
