"""Show the next test cut and the results of the test cuts so far."""

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
from lobewatch.show.terminal.json_fields import json_fields
from lobewatch.show.terminal.output import count_noun, new_table, remark_lines
from lobewatch.verdicts.speed_pockets import MAX_POCKET_GAIN, SpeedPocket

SPEED_POCKET_FIELDS = json_fields("speed_rpm window_rpm depth_mm=speed_rpm over_lowest_limit=gain")
SUGGESTED_CUT_FIELDS = json_fields("""
    speed_rpm depth_mm=depth chance_of_chatter=chatter_probability expected_gain=gain settles=most_informative repeats
""")
INTERVAL_FIELDS = json_fields("mean low high std")


def speed_pocket_json(pocket: SpeedPocket) -> dict[str, Any]:
    """Return one pocket, whose depth is not known."""
    return SPEED_POCKET_FIELDS(pocket) | {"depth_mm": None}


def speed_pocket_table(pockets: Sequence[SpeedPocket]) -> Table:
    """Return a table with a line for each pocket."""
    return new_table("speed (rpm)", "window (rpm)", "over the lowest limit", rows=map(_pocket_cells, pockets))


def _pocket_cells(pocket: SpeedPocket) -> list[str]:
    low, high = pocket.window_rpm
    gain = f"{pocket.gain:.1f} times" if pocket.gain < MAX_POCKET_GAIN else f"{MAX_POCKET_GAIN:g} times or more"
    return [format_rpm(round(pocket.speed_rpm)), f"{format_rpm(math.ceil(low))}..{format_rpm(math.floor(high))}", gain]


def speed_pockets_json(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> dict[str, Any]:
    """Return the pockets of a cut, and why no depth is known."""
    return {"cut": cut, "pockets": list(map(speed_pocket_json, pockets)), "remarks": merge_remarks(remarks)}


def speed_pockets_texts(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> list[str | Table]:
    """Return the pockets of a cut as a table, and why no depth is known."""
    heading = f"{cut}: pockets by frequency and damping, the largest removal rate first; how deep, test cuts tell"
    return [heading, speed_pocket_table(pockets), *remark_lines(remarks)]


def tried_depths_json(program: ProgramTable, depths: Sequence[PocketDepth], first: float) -> dict[str, Any]:
    """Return the next test cut, and the depths that were tried in each pocket; first: depth of the first cut (m)."""
    following = _next_depth(depths, first)
    return {
        "program": program.name,
        "suggested": following and {"speed_rpm": following[0], "depth_mm": _round_to_mm(following[1])},
        "pockets": [
            speed_pocket_json(tried.pocket)
            | {
                "cut_at_rpm": tried.speed_rpm,
                "cuts": [cut.id for cut in tried.cuts],
                "heard_stable_mm": _round_to_mm(tried.stable_depth) if tried.stable_depth else None,
                "heard_chatter_mm": _round_to_mm(tried.chatter_depth) if math.isfinite(tried.chatter_depth) else None,
            }
            for tried in depths
        ],
    }


def tried_depths_lines(
    program: ProgramTable, depths: Sequence[PocketDepth], first: float, folder: Path
) -> Iterator[str]:
    """Return the next test cut, and the depths that were stable; first: depth of the first cut (m)."""
    following = _next_depth(depths, first)
    if following is not None:
        speed, depth = following
        number = f"test cut {len(depths[0].cuts) + 1} of at most {MAX_POCKET_CUTS} in the pocket nearest to it"
        yield f"{program.name}: {number}: {format_rpm(speed)} rpm, {_round_to_mm(depth):g} mm"
        yield _observe_text(folder, program.name, speed, f"{_round_to_mm(depth):g}")
    stable = [tried for tried in depths if tried.stable_depth]
    for tried in stable:
        chatter = f", chatter at {_round_to_mm(tried.chatter_depth):g} mm" if math.isfinite(tried.chatter_depth) else ""
        place = f"{_round_to_mm(tried.stable_depth):g} mm at {format_rpm(tried.speed_rpm)} rpm"
        yield f"recommended by {count_noun(len(tried.cuts), 'cut')}: {place}, heard stable{chatter}"
    if not stable:
        yield "no depth is recommended yet: none was heard stable in a pocket"


def _observe_text(folder: Path, program: str, speed: float, depth: str) -> str:
    observe = shlex.join(["lobewatch", "observe", str(folder), "--program", program])
    return f"then: {observe} --speed {speed:g} --depth {depth} --stable (or --chatter --frequency HZ)"


def _next_depth(depths: Sequence[PocketDepth], first: float) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the next cut, in the nearest pocket; None where all are done."""
    wanted = depths[0].next_depth(first) if depths else None
    return None if wanted is None else (depths[0].speed_rpm, wanted)


def _round_to_mm(depth: float) -> float:
    return round(1e3 * depth, 4)


def suggestion_json(next_cut: NextCut) -> dict[str, Any]:
    """Return the next test cut, and what it rests on."""
    learning, best = next_cut.learning, _best_stable_cut(next_cut.learning)
    return {
        "program": learning.program.name,
        "suggested": next_cut.suggestion and _suggested_cut_json(next_cut.suggestion),
        "cuts_made": len(learning.own_cuts),
        "cuts_left": next_cut.cuts_left,
        "best_heard": best and {"speed_rpm": best[0], "depth_mm": 1e3 * best[1]},
        "learnt": learned_json(learning),
    }


def _suggested_cut_json(cut: Suggestion) -> dict[str, Any]:
    return SUGGESTED_CUT_FIELDS(cut) | {"depth_mm": round(1e3 * cut.depth, 6), "repeats": cut.repeats or None}


def suggestion_lines(next_cut: NextCut, folder: Path) -> Iterator[str]:
    """Return the next test cut, how to enter it, and the best stable cut so far."""
    learning, cut = next_cut.learning, next_cut.suggestion
    program, n_made = learning.program, len(learning.own_cuts)
    if cut is None:
        yield f"{program.name}: {_no_suggestion_text(next_cut)}"
    else:
        depth = f"{1e3 * cut.depth:.4g}"
        number = f"test cut {n_made + 1} of {n_made + next_cut.cuts_left}"
        yield (
            f"{program.name}: {number}: {format_rpm(cut.speed_rpm)} rpm, {depth} mm, "
            f"chance of chatter {round(100 * cut.chatter_probability)} %; {_suggestion_reason(cut, learning)}"
        )
        power = "" if program.feed_per_tooth_mm is None else "; --power KW, where it is shown, tells Kt"
        yield _observe_text(folder, program.name, cut.speed_rpm, depth) + power
    best = _best_stable_cut(learning)
    if best is not None:
        gain = f"; the next is expected to gain {100 * cut.gain:.0f} %" if cut and math.isfinite(cut.gain) else ""
        yield f"most chips heard stable: {1e3 * best[1]:.4g} mm at {format_rpm(best[0])} rpm{gain}"
    yield "a test cut is no advice: lobewatch check says what may be run"


def _suggestion_reason(cut: Suggestion, learning: LearningResult) -> str:
    if cut.repeats:
        is_believed = cut.repeats in [made.id for made in learning.accepted_cuts]
        return f"{cut.repeats} once more, since {'its word may be wrong' if is_believed else 'it is not believed'}"
    return f"it tells most of {factor_text(cut.most_informative)}"


def _no_suggestion_text(next_cut: NextCut) -> str:
    if not next_cut.cuts_left:
        return f"{len(next_cut.learning.own_cuts)} test cuts are made; a larger --cuts asks for more"
    if next_cut.cut_range.is_empty:
        return f"no test cut: {next_cut.cut_range.text}; choose another tool"
    return "no test cut is worth making: nothing more is to be gained"


def _best_stable_cut(learning: LearningResult) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the stable cut with the largest removal rate; None where none was stable."""
    accepted = [cut for cut in learning.own_cuts if cut not in learning.rejected_cuts]
    stable = [(cut.speed_rpm, cut.depth) for cut in accepted if not cut.has_chatter]
    return max(stable, key=lambda setting: setting[0] * setting[1], default=None)


def learned_json(learning: LearningResult) -> dict[str, Any]:
    """Return factors on what was measured at rest (Kt and Kr/Kt: on machine.toml), before and after the test cuts."""
    before, after = learning.prior.intervals, learning.posterior.intervals
    return {
        "cuts": [cut.id for cut in learning.accepted_cuts],
        "chatter_frequencies": learning.posterior.n_frequencies,
        "frequency_learnt": learning.posterior.n_frequencies > 0,
        "effective_sample_size": learning.posterior.effective_size,
        "factors": {name: INTERVAL_FIELDS(after[name]) | {"before": INTERVAL_FIELDS(before[name])} for name in after},
    }


def learned_texts(learning: LearningResult) -> list[str | Table]:
    """Return a table of what the test cuts have taught; nothing where there are none."""
    count = len(learning.accepted_cuts)
    return [f"learnt from {count_noun(count, 'cut')}:", learned_table(learning)] if count else []


def learned_table(learning: LearningResult) -> Table:
    """Return a table of the factors before and after the test cuts."""
    before, after = learning.prior.intervals, learning.posterior.intervals
    rows = ((factor_text(name), _interval_text(before[name]), _learned_text(learning, name)) for name in after)
    return new_table("~at speed, over at rest", "before (95 %)", "learnt (95 %)", rows=rows)


def _learned_text(learning: LearningResult, name: str) -> str:
    is_open = name.startswith("frequency") and not learning.posterior.n_frequencies
    return "not learnt" if is_open else _interval_text(learning.posterior.intervals[name])


def _interval_text(interval: Interval) -> str:
    return f"{interval.mean:.3f} ({interval.low:.3f}..{interval.high:.3f})"


def learned_remarks(learning: LearningResult) -> Iterator[Remark]:
    """Return remarks on rejected cuts, and on what the cuts do not determine."""
    yield from inconsistent_cut_remarks(learning.posterior, learning.inconsistent_cuts, learning.program.name)
    if learning.accepted_cuts and not learning.posterior.n_frequencies:
        text = "f not learnt: no chatter frequency was heard yet"
        yield Remark("frequency-not-learnt", learning.program.name, text, "tell what the next chatter sounds at")
