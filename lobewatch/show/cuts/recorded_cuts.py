"""Show recorded cuts with verdict and evidence, the next test cut, and the results of the test cuts so far."""

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import Remark, merge_remarks
from lobewatch.cuts.chatter_detection.peak_classification import MIN_TOOTH_HARMONICS
from lobewatch.cuts.chatter_detection.spindle_speed import is_pulse_multiple
from lobewatch.cuts.learning.pocket_depth import MAX_POCKET_CUTS, PocketDepth
from lobewatch.cuts.learning.posterior import inconsistent_cut_remarks
from lobewatch.cuts.learning.program_learning import LearningResult, NextCut
from lobewatch.cuts.learning.suggestion import Suggestion
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.machine import ProgramTable
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.materials import power_json, power_text
from lobewatch.show.programs.verdicts import factor_text
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick, remark_lines
from lobewatch.verdicts.speed_pockets import MAX_POCKET_GAIN, SpeedPocket

FAULT_TEXTS: Mapping[str, str] = {
    "too-short": "less than 0.3 s of cut to listen to; record a second or longer, with air before it",
    "no-cut": "nothing in it gets louder: record from the spindle turning in air into the cut",
    "no-air": "no 0.15 s of the spindle turning in air beside the cut, or its lines are there as well, so that it is "
    "not known what is there without a cut; record the spindle in air, then the cut",
    "knock": "a knock in the cut, as of a hammer; cut again without it",
    "overload": "the accelerometer or its input was overloaded; choose a larger range or another place",
    "lost-scans": "scans were lost in it; lower the sample rate or use another cable or port",
    "speed-not-found": "no spindle speed within 5 % of the one that was set fits its lines; correct the speed",
    "tacho-contradicts": "the tachometer turns at another speed than the lines of the cut",
    "on-spindle-lines": "the lines of run-out are louder than tooth passing: chatter of two tooth periods of an even "
    "number of teeth, or chatter that has locked to the spindle, sounds alike; cut at a speed 3 % away, and give "
    "pitch_deg where the teeth are unevenly spaced",
    "faint": "lines beside those of the spindle, too faint to be called chatter; cut longer or a little deeper",
    "unexplained-tone": "a tone that neither the spindle, nor its teeth, nor air explains, without the side bands that "
    "a cut gives to chatter; cut a little deeper, and listen for it without the cut",
    "slow-sampling": "fewer than three multiples of tooth passing are heard at this sample rate; take a higher one",
}
"""Fault and remedy for each reason without a verdict."""


MICROPHONE_NOTE = (
    "by microphone: it hears the shop too, so that a tone of another machine that runs in the cut alone is not known "
    "from one of the cut, and it does not tell how far the tool moves"
)
"""Limits of a recording by microphone."""


NEXT_STEP_TEXTS: Mapping[str, str] = {
    "stable": "lobewatch suggest names the next test cut; a deeper one teaches more",
    "chatter": "cut less deep or at another speed; lobewatch suggest names the next test cut",
    "flip": "cut at another speed, or less deep; lobewatch suggest names the next test cut",
    "cannot tell": "listen again; this one teaches nothing",
}
"""Next step for each verdict on a recorded cut."""


def reason_text(comparison: CutComparison) -> str:
    """Return what the verdict on a recorded cut rests on, or why there is none."""
    heard = comparison.detected
    return _fault_text(comparison) if heard.verdict == "cannot tell" else _energy_text(heard.energy_ratio)


def _fault_text(comparison: CutComparison) -> str:
    """Return the fault and its remedy, with the numbers of this cut."""
    detected = comparison.detected
    text = FAULT_TEXTS[detected.reason]
    match detected.reason:
        case "speed-not-found" if math.isfinite(detected.distant_rpm):
            return f"{text}; these lines fit {detected.distant_rpm:.0f} rpm"
        case "tacho-contradicts":
            return f"{text}: {_speed_conflict_text(comparison)}"
        case "slow-sampling":
            return f"{text}: {2 * MIN_TOOTH_HARMONICS * comparison.tooth_passing_frequency:.0f} Hz or more"
        case "unexplained-tone":
            mode, tone = comparison.nearest_mode_frequency(detected.tone), detected.tone
            distance = "" if mode is None else f", {abs(mode - tone):.1f} Hz from the mode at {mode:.1f} Hz"
            return f"at {tone:.1f} Hz{distance}: {text}"
    return text


def _speed_conflict_text(comparison: CutComparison) -> str:
    heard, set_rpm = comparison.detected, comparison.setting.speed_rpm
    measured, lines = heard.measured_rpm or math.nan, heard.distant_rpm
    both = f"{measured:.1f} rpm, not the {lines:.1f} rpm that {'was set' if lines == set_rpm else 'the lines fit'}"
    if not is_pulse_multiple(measured / lines):
        return f"{both}; correct --speed, or name the column that is meant"
    size = "small" if measured > lines else "large"
    return f"{both}; --pulses is {round(max(measured / lines, lines / measured))} times too {size}, or correct --speed"


def _energy_text(ratio: float) -> str:
    digits = ".2g" if ratio < 1 else ".0f"
    return f"beside the lines of the spindle: {100 * ratio:{digits}} % of their energy"


def cut_verdict_text(comparison: CutComparison) -> str:
    """Return the verdict on a recorded cut, with the chatter frequency or the fault."""
    heard, chatter = comparison.detected, comparison.detected.chatter
    if heard.verdict == "cannot tell":
        return f"cannot tell ({heard.reason}): {_fault_text(comparison)}"
    if chatter is None:
        return "stable"
    named = "period-two chatter" if heard.verdict == "flip" else "chatter"
    return f"{named} at {chatter.frequency:.1f} +- {max(2 * chatter.error, 0.1):.1f} Hz"


def recorded_cut_texts(comparison: CutComparison) -> list[str]:
    """Return the verdict on a recorded cut, and what it rests on."""
    detected, texts = comparison.detected, [cut_verdict_text(comparison)]
    if detected.spindle_speed is not None:
        off = 100 * (comparison.speed_rpm / comparison.setting.speed_rpm - 1)
        duration = math.nan if detected.spectrum is None else 1 / detected.spectrum.bin_width
        texts.append(
            f"{comparison.speed_rpm:.1f} rpm ({off:+.2f} % of {comparison.setting.speed_rpm:g}), tooth passing "
            f"{comparison.tooth_passing_frequency:.1f} Hz; listened to {duration:.2f} s"
        )
    if (measured := detected.measured_rpm) is not None:
        texts.append(f"tachometer: {'no speed in the cut' if math.isnan(measured) else f'{measured:.1f} rpm'}")
    if math.isfinite(detected.energy_ratio):
        texts.append(_energy_text(detected.energy_ratio))
    if detected.chatter is not None:
        lobe = comparison.lobe_number
        texts.append(f"lobe {lobe} ({lobe} whole waves between two teeth), {len(detected.chatter.peaks)} side bands")
    if comparison.sensor == "microphone":
        texts.append(MICROPHONE_NOTE)
    if comparison.power is not None:
        texts.append(power_text(comparison.power, comparison.setting.cut))
    if (expected := comparison.predicted) is not None:
        difference = comparison.frequency_difference
        apart = "" if difference is None else f", {difference:.1f} Hz from what was heard modulo tooth passing"
        word = "stable" if expected.stable else "chatter"
        texts.append(f"by the tap tests, at rest: {word}, at this depth {expected.frequency:.1f} Hz{apart}")
    return texts


def recording_texts(comparisons: Sequence[CutComparison], saved: Sequence[str] = ()) -> list[str]:
    """Return what was detected in each cut of a recording; saved: names under which the cuts are kept."""
    texts = list[str]()
    for number, comparison in enumerate(comparisons):
        parts = comparison.detected.parts
        if len(comparisons) > 1:
            texts.append(f"cut {number + 1} of {len(comparisons)}, {parts.begin:.2f} to {parts.end:.2f} s:")
        texts += [*recorded_cut_texts(comparison), *(f"saved {name}" for name in saved[number : number + 1])]
    return texts


def recorded_cut_json(comparison: CutComparison) -> JsonObject:
    """Return a recorded cut with all that was detected in it."""
    heard, chatter, expected = comparison.detected, comparison.detected.chatter, comparison.predicted
    return {
        "word": heard.verdict,
        "reason": heard.reason,
        "chatter_frequency_hz": chatter and chatter.frequency,
        "chatter_frequency_hz_std": chatter and chatter.error,
        "elsewhere_rpm": heard.distant_rpm,
        "unexplained_tone_hz": heard.tone,
        "sensor": comparison.sensor,
        "speed_rpm": heard.speed_rpm,
        "speed_rpm_std": heard.spindle_speed and heard.spindle_speed.error * 60,
        "commanded_rpm": comparison.setting.speed_rpm,
        "measured_rpm": heard.measured_rpm,
        "depth_mm": comparison.setting.depth * 1e3,
        "tooth_frequency_hz": comparison.tooth_passing_frequency,
        "energy_ratio": heard.energy_ratio,
        "lobe": comparison.lobe_number,
        "side_bands_hz": sorted(chatter.peaks.frequency.tolist()) if chatter else [],
        **power_json(comparison.power),
        "predicted": expected and ("stable" if expected.stable else "chatter"),
        "predicted_frequency_hz": expected and expected.frequency,
        "predicted_apart_hz": comparison.frequency_difference,
        "begin_s": heard.parts.begin,
        "end_s": heard.parts.end,
        "steady_begin_s": heard.parts.steady_begin,
        "steady_end_s": heard.parts.steady_end,
    }


def recording_json(comparisons: Sequence[CutComparison], more: Sequence[Mapping[str, Any]] = ()) -> JsonObject:
    """Return the cut in a recording, several as a list in `cuts`; more: further keys of each."""
    cuts = [recorded_cut_json(comparison) for comparison in comparisons]
    for cut, keys in zip(cuts, more, strict=False):
        cut.update(keys)
    return cuts[0] if len(cuts) == 1 else {"cuts": cuts}


def _round_to_mm(depth: float) -> float:
    return round(1e3 * depth, 4)


def _known_mm(depth: float) -> float | None:
    return _round_to_mm(depth) if depth and math.isfinite(depth) else None


def speed_pocket_json(pocket: SpeedPocket) -> JsonObject:
    """Return one pocket of unknown depth."""
    return {**pick(pocket, "speed_rpm", "window_rpm"), "depth_mm": None, "over_lowest_limit": pocket.gain}


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


def tried_depths_json(table: ProgramTable, depths: Sequence[PocketDepth], first: float) -> JsonObject:
    """Return the next test cut, and the depths that were tried in each pocket; first: depth of the first cut (m)."""
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
        number = f"test cut {len(depths[0].cuts) + 1} of at most {MAX_POCKET_CUTS} in the pocket nearest to it"
        yield f"{table.name}: {number}: {format_rpm(speed)} rpm, {_round_to_mm(depth):g} mm"
        yield _observe_text(folder, table.name, speed, f"{_round_to_mm(depth):g}")
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
    if next_cut.cut_range.is_empty:
        return f"no test cut: {next_cut.cut_range.text}; choose another tool"
    return "no test cut is worth making: nothing more is to be gained"


def _best_stable_cut(learning: LearningResult) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the stable cut with the largest removal rate; None where none was stable."""
    accepted = [cut for cut in learning.own_cuts if cut not in learning.rejected_cuts]
    stable = [(cut.speed_rpm, cut.depth) for cut in accepted if not cut.has_chatter]
    return max(stable, key=lambda setting: setting[0] * setting[1], default=None)


def learned_json(learning: LearningResult) -> JsonObject:
    """Return factors on what was measured at rest (Kt and Kr/Kt: on machine.toml), before and after the test cuts."""
    before, posterior = learning.prior.intervals, learning.posterior
    factors = {name: {**now._asdict(), "before": before[name]._asdict()} for name, now in posterior.intervals.items()}
    return {
        "cuts": [cut.id for cut in learning.accepted_cuts],
        "chatter_frequencies": posterior.n_frequencies,
        "frequency_learnt": bool(posterior.n_frequencies),
        "effective_sample_size": posterior.effective_size,
        "factors": factors,
    }


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
