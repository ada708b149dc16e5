"""Show the next test cut to make and what test cuts have taught."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from operator import attrgetter
from pathlib import Path

from rich.table import Table

from acquisition import Remark, merge_remarks
from lobewatch.cuts.learning.label_check import inconsistent_cut_remarks
from lobewatch.cuts.learning.pocket_depth import MAX_POCKET_CUTS, PocketDepth
from lobewatch.cuts.learning.program_learning import LearningResult, NextCut
from lobewatch.cuts.learning.suggestion import Suggestion
from lobewatch.machine import ProgramTable
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.verdicts import factor_text
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, json_fields, new_table, remark_lines
from lobewatch.verdicts.speed_pockets import MAX_POCKET_GAIN, SpeedPocket


def _round_to_mm(depth: float) -> float:
    return round(1e3 * depth, 4)


def _known_mm(depth: float) -> float | None:
    return _round_to_mm(depth) if depth and math.isfinite(depth) else None


speed_pocket_json = json_fields(
    "speed_rpm window_rpm depth_mm=self over_lowest_limit=gain", {"depth_mm": lambda _: None}
)
"""Function that returns one pocket, whose depth is not known."""
TRIED_FIELDS = json_fields(
    "cut_at_rpm=speed_rpm cuts heard_stable_mm=stable_depth heard_chatter_mm=chatter_depth",
    {"cuts": attrgetter("id"), "heard_stable_mm": _known_mm, "heard_chatter_mm": _known_mm},
)
SUGGESTED_CUT_FIELDS = json_fields(
    """
    speed_rpm depth_mm=depth chance_of_chatter=chatter_probability expected_gain=gain settles=most_informative repeats
    """,
    {"depth_mm": lambda depth: round(1e3 * depth, 6), "repeats": lambda name: name or None},
)
INTERVAL_FIELDS = json_fields("mean low high std")
LEARNED_FIELDS = json_fields(
    """
    cuts=accepted_cuts chatter_frequencies=posterior.n_frequencies frequency_learnt=posterior.n_frequencies
    effective_sample_size=posterior.effective_size
    """,
    {"cuts": attrgetter("id"), "frequency_learnt": bool},
)


def speed_pocket_table(pockets: Sequence[SpeedPocket]) -> Table:
    """Return a table with a line for each pocket."""
    table = new_table("speed (rpm)", "window (rpm)", "over the lowest limit")
    for pocket in pockets:
        low, high = math.ceil(pocket.window_rpm[0]), math.floor(pocket.window_rpm[1])
        gain = f"{pocket.gain:.1f} times" if pocket.gain < MAX_POCKET_GAIN else f"{MAX_POCKET_GAIN:g} times or more"
        table.add_row(format_rpm(round(pocket.speed_rpm)), f"{format_rpm(low)}..{format_rpm(high)}", gain)
    return table


def speed_pockets_json(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> JsonObject:
    """Return the pockets of a cut, and why no depth is known."""
    return {"cut": cut, "pockets": list(map(speed_pocket_json, pockets)), "remarks": merge_remarks(remarks)}


def speed_pockets_texts(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> Texts:
    """Return the pockets of a cut as a table, and why no depth is known."""
    heading = f"{cut}: pockets by frequency and damping, the largest removal rate first; how deep, test cuts tell"
    return [heading, speed_pocket_table(pockets), *remark_lines(remarks)]


def tried_depths_json(program: ProgramTable, depths: Sequence[PocketDepth], first: float) -> JsonObject:
    """Return the next test cut, and the depths that were tried in each pocket; first: depth of the first cut (m)."""
    following = _next_depth(depths, first)
    return {
        "program": program.name,
        "suggested": following and {"speed_rpm": following[0], "depth_mm": _round_to_mm(following[1])},
        "pockets": [speed_pocket_json(tried.pocket) | TRIED_FIELDS(tried) for tried in depths],
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


def suggestion_json(next_cut: NextCut) -> JsonObject:
    """Return the next test cut, and what it rests on."""
    learning, best = next_cut.learning, _best_stable_cut(next_cut.learning)
    return {
        "program": learning.program.name,
        "suggested": next_cut.suggestion and SUGGESTED_CUT_FIELDS(next_cut.suggestion),
        "cuts_made": len(learning.own_cuts),
        "cuts_left": next_cut.cuts_left,
        "best_heard": best and {"speed_rpm": best[0], "depth_mm": 1e3 * best[1]},
        "learnt": learned_json(learning),
    }


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
    reason = f"no test cut: {next_cut.cut_range.text}; choose another tool"
    return reason if next_cut.cut_range.is_empty else "no test cut is worth making: nothing more is to be gained"


def _best_stable_cut(learning: LearningResult) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the stable cut with the largest removal rate; None where none was stable."""
    accepted = [cut for cut in learning.own_cuts if cut not in learning.rejected_cuts]
    stable = [(cut.speed_rpm, cut.depth) for cut in accepted if not cut.has_chatter]
    return max(stable, key=lambda setting: setting[0] * setting[1], default=None)


def learned_json(learning: LearningResult) -> JsonObject:
    """Return factors on what was measured at rest (Kt and Kr/Kt: on machine.toml), before and after the test cuts."""
    before, after = learning.prior.intervals, learning.posterior.intervals
    factors = {name: INTERVAL_FIELDS(after[name]) | {"before": INTERVAL_FIELDS(before[name])} for name in after}
    return LEARNED_FIELDS(learning) | {"factors": factors}


def learned_texts(learning: LearningResult) -> Texts:
    """Return a table of what the test cuts have taught; nothing where there are none."""
    count, table = len(learning.accepted_cuts), new_table("~at speed, over at rest", "before (95 %)", "learnt (95 %)")
    for name, interval in learning.posterior.intervals.items():
        both = learning.prior.intervals[name], interval
        before, after = (f"{value.mean:.3f} ({value.low:.3f}..{value.high:.3f})" for value in both)
        is_open = name.startswith("frequency") and not learning.posterior.n_frequencies
        table.add_row(factor_text(name), before, "not learnt" if is_open else after)
    return [f"learnt from {count_noun(count, 'cut')}:", table] if count else []


def learned_remarks(learning: LearningResult) -> Iterator[Remark]:
    """Return remarks on rejected cuts, and on what the cuts do not determine."""
    yield from inconsistent_cut_remarks(learning.posterior, learning.inconsistent_cuts, learning.program.name)
    if learning.accepted_cuts and not learning.posterior.n_frequencies:
        text = "f not learnt: no chatter frequency was heard yet"
        yield Remark("frequency-not-learnt", learning.program.name, text, "tell what the next chatter sounds at")
