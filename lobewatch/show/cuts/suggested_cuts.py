"""Show the next test cut, the depths already cut in each pocket, and the values learned from test cuts."""

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.table import Table

from acquisition import Remark, merge_remarks
from acquisition.errors import join_sentences
from lobewatch.cuts.learning.cut_likelihood import CutEvidence
from lobewatch.cuts.learning.pocket_depth import MAX_POCKET_CUTS, PocketDepth
from lobewatch.cuts.learning.posterior import inconsistent_cut_remarks
from lobewatch.cuts.learning.program_learning import LearningResult, NextCut
from lobewatch.cuts.learning.suggestion import Suggestion
from lobewatch.machine import ProgramTable
from lobewatch.machine.settings.display_units import LENGTH, length_argument
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.verdicts import chance_text, factor_text
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick, remark_lines
from lobewatch.verdicts.speed_pockets import MAX_POCKET_GAIN, SpeedPocket


def _round_to_mm(depth: float) -> float:
    return round(1e3 * depth, 4)


def _depth_text(depth: float) -> str:
    return LENGTH.text(_round_to_mm(depth))


def _known_mm(depth: float) -> float | None:
    return _round_to_mm(depth) if depth and math.isfinite(depth) else None


def speed_pocket_json(pocket: SpeedPocket) -> JsonObject:
    """Return one pocket of unknown depth."""
    return {**pick(pocket, "speed_rpm", "window_rpm"), "depth_mm": None, "over_lowest_limit": pocket.gain}


def speed_pocket_table(pockets: Sequence[SpeedPocket]) -> Table:
    """Return a table with a line for each pocket."""
    table = new_table("speed (rpm)", "stable (rpm)", "limit / lowest limit")
    for pocket in pockets:
        low, high = math.ceil(pocket.window_rpm[0]), math.floor(pocket.window_rpm[1])
        gain = f"{pocket.gain:.1f}" if pocket.gain < MAX_POCKET_GAIN else f"{MAX_POCKET_GAIN:g} or more"
        table.add_row(format_rpm(round(pocket.speed_rpm)), f"{format_rpm(low)}..{format_rpm(high)}", gain)
    return table


def speed_pockets_json(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> JsonObject:
    """Return the stable pockets of a cut, and the remarks on their unknown depth."""
    return {"cut": cut, "pockets": list(map(speed_pocket_json, pockets)), "remarks": merge_remarks(remarks)}


def speed_pockets_texts(cut: str, pockets: Sequence[SpeedPocket], remarks: Sequence[Remark]) -> Texts:
    """Return the stable pockets of a cut as a table, and the remarks on their unknown depth."""
    heading = f"{cut}: stable pockets from frequency and damping, highest removal rate first"
    return [heading, speed_pocket_table(pockets), *remark_lines(remarks)]


def tried_depths_json(table: ProgramTable, depths: Sequence[PocketDepth], first: float) -> JsonObject:
    """Return the next test cut, and the depths already cut in each pocket; first: depth of the first cut (m)."""
    following = _next_depth(depths, first)
    return {
        "program": table.name,
        "suggested": following and {"speed_rpm": following[0], "depth_mm": _round_to_mm(following[1])},
        "pockets": [
            {
                **speed_pocket_json(tried.pocket),
                "cut_at_rpm": tried.speed_rpm,
                "cuts": [cut.id for cut in tried.cuts],
                "heard_stable_mm": _known_mm(tried.stable_depth),
                "heard_chatter_mm": _known_mm(tried.chatter_depth),
            }
            for tried in depths
        ],
    }


def tried_depths_lines(table: ProgramTable, depths: Sequence[PocketDepth], first: float, folder: Path) -> Iterator[str]:
    """Return the next test cut, and the depths that were stable; first: depth of the first cut (m)."""
    following = _next_depth(depths, first)
    if following is not None:
        speed, depth = following
        number = f"test cut {len(depths[0].cuts) + 1} of at most {MAX_POCKET_CUTS} in the nearest pocket"
        yield f"{table.name}: {format_rpm(speed)} rpm, {_depth_text(depth)} ({number})"
        yield observe_text(folder, table.name, speed, _round_to_mm(depth))
    stable = [tried for tried in depths if tried.stable_depth]
    for tried in stable:
        chatter = f", chatter at {_depth_text(tried.chatter_depth)}" if math.isfinite(tried.chatter_depth) else ""
        place = f"{_depth_text(tried.stable_depth)} at {format_rpm(tried.speed_rpm)} rpm"
        yield f"Recommended after {count_noun(len(tried.cuts), 'cut')}: {place}, stable{chatter}"
    if not stable:
        yield "No recommended depth yet: no test cut in a pocket was stable"


def observe_text(folder: Path, program: str, speed: float, depth_mm: float) -> str:
    """Return the command that enters the result of a test cut."""
    observe = observe_command(folder, program, speed, depth_mm)
    return f"Enter the result: {observe} --stable (or --chatter --frequency HZ)"


def observe_command(folder: Path, program: str, speed: float, depth_mm: float) -> str:
    """Return the command that enters a cut, without its verdict."""
    place = ["--speed", f"{speed:g}", "--depth", length_argument(depth_mm, ".4g")]
    return shlex.join(["lobewatch", "observe", str(folder), "--program", program, *place])


def question_lines(asked: CutEvidence, program: str, folder: Path) -> Iterator[str]:
    """Return the question whether a cut was stable, and how to answer it with and without a cut."""
    observe = observe_command(folder, program, asked.speed_rpm, 1e3 * asked.depth)
    place = f"{format_rpm(asked.speed_rpm)} rpm, {LENGTH.text(1e3 * asked.depth, '.4g')}"
    yield f"Was {asked.id} stable at {place}? Other cuts put it in doubt."
    exclude = shlex.join(["lobewatch", "exclude", str(folder), asked.id, "--reason", "wrong verdict"])
    yield f"If it chattered: {exclude}"
    yield f"Then: {observe} --chatter (with --frequency HZ and --power KW if known)"
    yield f"If unsure, repeat the cut: {observe} --stable (or --chatter --frequency HZ)"


def _next_depth(depths: Sequence[PocketDepth], first: float) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the next cut, in the nearest pocket; None if all are done."""
    wanted = depths[0].next_depth(first) if depths else None
    return None if wanted is None else (depths[0].speed_rpm, wanted)


def suggestion_json(next_cut: NextCut) -> JsonObject:
    """Return the next test cut, and the result of those so far."""
    learning, best, cut = next_cut.learning, _best_stable_cut(next_cut.learning), next_cut.suggestion
    suggested = cut and {
        "speed_rpm": cut.speed_rpm,
        "depth_mm": round(1e3 * cut.depth, 6),
        "chance_of_chatter": cut.chatter_probability,
        "expected_gain": cut.gain,
        "settles": cut.most_informative,
        "repeats": cut.repeats or None,
    }
    return {
        "program": learning.program.name,
        "suggested": suggested,
        "asks": next_cut.asked and next_cut.asked.id,
        "cuts_made": len(learning.own_cuts),
        "cuts_left": next_cut.cuts_left,
        "best_heard": best and {"speed_rpm": best[0], "depth_mm": 1e3 * best[1]},
        "learnt": learned_json(learning),
    }


def suggestion_lines(next_cut: NextCut, folder: Path) -> Iterator[str]:
    """Return the next test cut, how to enter it, and the best stable cut so far."""
    learning, cut = next_cut.learning, next_cut.suggestion
    program, n_made = learning.program, len(learning.own_cuts)
    if next_cut.asked is not None:
        yield from question_lines(next_cut.asked, program.name, folder)
    if cut is None:
        yield f"{program.name}: {_no_suggestion_text(next_cut)}"
    else:
        number = f"test cut {n_made + 1} of {n_made + next_cut.cuts_left}"
        yield f"{program.name}: {format_rpm(cut.speed_rpm)} rpm, {LENGTH.text(1e3 * cut.depth, '.4g')} ({number})"
        risk = chance_text(cut.chatter_probability)
        yield f"Chance of chatter at speed: {risk}, {_suggestion_reason(cut, next_cut)}"
        yield observe_text(folder, program.name, cut.speed_rpm, 1e3 * cut.depth)
        if program.feed_per_tooth_mm is not None:
            yield "Add --power KW if the drive shows its power. lobewatch computes Kt from the power."
    best = _best_stable_cut(learning)
    if best is not None:
        gain = f", expected gain of the next test cut {100 * cut.gain:.0f} %" if cut and 0 < cut.gain < math.inf else ""
        yield f"Best stable test cut: {LENGTH.text(1e3 * best[1], '.4g')} at {format_rpm(best[0])} rpm{gain}"
    yield "A test cut may chatter. For safe settings run lobewatch check."


def _suggestion_reason(cut: Suggestion, next_cut: NextCut) -> str:
    if cut.repeats:
        is_accepted = cut.repeats in [made.id for made in next_cut.learning.accepted_cuts]
        return f"the cut repeats {cut.repeats}, which {'may be wrong' if is_accepted else 'contradicts the other cuts'}"
    if next_cut.asked is not None and cut.gain < 0:
        return f"a cut that is worth most if {next_cut.asked.id} chattered"
    return f"the cut determines mostly {factor_text(cut.most_informative)}"


def _no_suggestion_text(next_cut: NextCut) -> str:
    if not next_cut.cuts_left:
        finding = f"all {len(next_cut.learning.own_cuts)} test cuts are done"
        return join_sentences(finding, "Give a larger --cuts for more test cuts")
    if next_cut.cut_range.is_empty:
        return join_sentences(f"no test cut is possible in {next_cut.cut_range.text}", "Choose another tool")
    return "no further test cut, because another test cut would gain nothing"


def _best_stable_cut(learning: LearningResult) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the stable cut with the largest removal rate; None without a stable cut."""
    accepted = [cut for cut in learning.own_cuts if cut not in learning.rejected_cuts]
    stable = [(cut.speed_rpm, cut.depth) for cut in accepted if not cut.has_chatter]
    return max(stable, key=lambda setting: setting[0] * setting[1], default=None)


def learned_json(learning: LearningResult) -> JsonObject:
    """Return factors on values not rotating (Kt and Kr/Kt: on machine.toml), before and after the test cuts."""
    before, posterior = learning.prior.intervals, learning.posterior
    factors = {name: {**now._asdict(), "before": before[name]._asdict()} for name, now in posterior.intervals.items()}
    return {
        "cuts": [cut.id for cut in learning.accepted_cuts],
        "chatter_frequencies": posterior.n_frequencies,
        "frequency_learnt": bool(posterior.n_frequencies),
        "effective_sample_size": posterior.effective_size,
        "factors": factors,
        "drive_gain": posterior.drive_gain and posterior.drive_gain._asdict(),
    }


def learned_texts(learning: LearningResult) -> Texts:
    """Return a table of the factors learned from test cuts; empty without test cuts."""
    headings = "~ratio, rotating / not rotating", "before (95 %)", "learned (95 %)"
    count, table = len(learning.accepted_cuts), new_table(*headings)
    for name, interval in learning.posterior.intervals.items():
        both = learning.prior.intervals[name], interval
        before, after = (f"{value.mean:.3f} ({value.low:.3f}..{value.high:.3f})" for value in both)
        is_open = name.startswith("frequency") and not learning.posterior.n_frequencies
        table.add_row(factor_text(name), before, "not learned" if is_open else after)
    return [f"Learned from {count_noun(count, 'test cut')}:", table] if count else []


def learned_remarks(learning: LearningResult) -> Iterator[Remark]:
    """Return remarks on rejected cuts, and on factors that the cuts do not determine."""
    yield from inconsistent_cut_remarks(learning.posterior, learning.inconsistent_cuts, learning.program.name)
    if learning.accepted_cuts and not learning.posterior.n_frequencies:
        text = "frequency not learned: no cut with a chatter frequency yet"
        yield Remark(
            "frequency-not-learnt", learning.program.name, text, "Give --frequency with the next test cut that chatters"
        )
