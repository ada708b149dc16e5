"""Show recorded cuts with verdict and evidence, the next test cut, and the results of the test cuts so far."""

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.table import Table

from acquisition import Remark, merge_remarks
from acquisition.errors import join_sentences
from lobewatch.cuts.chatter_detection.peak_classification import MIN_TOOTH_HARMONICS
from lobewatch.cuts.chatter_detection.spindle_speed import is_pulse_multiple
from lobewatch.cuts.learning.pocket_depth import MAX_POCKET_CUTS, PocketDepth
from lobewatch.cuts.learning.posterior import inconsistent_cut_remarks
from lobewatch.cuts.learning.program_learning import LearningResult, NextCut
from lobewatch.cuts.learning.suggestion import Suggestion
from lobewatch.logbook.cut_comparison import CutComparison, find_worst_cut
from lobewatch.machine import ProgramTable
from lobewatch.show.cuts.cut_parts import MICROPHONE_NOTE, parts_json, parts_texts, recorded_cut_remarks
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.materials import power_json, power_text
from lobewatch.show.programs.verdicts import chance_text, factor_text
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick, remark_lines
from lobewatch.verdicts.speed_pockets import MAX_POCKET_GAIN, SpeedPocket


class Fault(NamedTuple):
    """Fault of a recorded cut that allows no verdict."""

    finding: str
    """Finding without a full stop."""
    remedy: str
    """Remedy as an imperative sentence without a full stop."""


FAULTS: Mapping[str, Fault] = {
    "too-short": Fault("less than 0.3 s of cutting", "Record the spindle in air, then at least 1 s of cutting"),
    "no-cut": Fault("the signal level never rises", "Start the recording in air, then cut"),
    "no-air": Fault("no usable 0.15 s in air before or after the cut", "Record the spindle in air, then cut"),
    "knock": Fault("a knock, such as a hammer blow, during the cut", "Repeat the cut without a knock"),
    "overload": Fault("the accelerometer or its input was overloaded", "Choose a larger range or another position"),
    "lost-scans": Fault("samples were lost", "Lower the sample rate, or use another cable or port"),
    "speed-not-found": Fault("no speed within 5 % of the set speed fits the spectrum", "Correct the set speed"),
    "tacho-contradicts": Fault("the tachometer contradicts the set speed", "Correct --speed, or choose --tacho"),
    "on-spindle-lines": Fault(
        "run-out lines are louder than tooth passing, which may hide chatter locked to the spindle",
        "Cut at a 3 % higher or lower speed, and give pitch_deg for unevenly spaced flutes",
    ),
    "teeth-contradicted": Fault(
        "the spindle harmonics contradict the number of flutes", "Correct the number of flutes"
    ),
    "faint": Fault("lines outside the spindle harmonics are too weak to prove chatter", "Cut longer or deeper"),
    "unexplained-tone": Fault(
        "is not explained by spindle, flutes or air, and has no side bands of chatter",
        "Cut a little deeper, and check whether the tone is there without cutting",
    ),
    "slow-sampling": Fault("the sample rate covers fewer than three harmonics of tooth passing", "Use a higher rate"),
}
"""Fault for each reason without a verdict."""


SUGGEST_HINT = "Run lobewatch suggest for the next test cut"
NEXT_STEP_TEXTS: Mapping[str, str] = {
    "stable": join_sentences(SUGGEST_HINT, "A deeper test cut gives more information"),
    "chatter": join_sentences("Cut less deep or at another speed", SUGGEST_HINT),
    "flip": join_sentences("Cut at another speed or less deep", SUGGEST_HINT),
    "cannot tell": "Record the cut again, because this recording gives no verdict",
}
"""Next step for each verdict on a recorded cut."""


def reason_text(comparison: CutComparison) -> str:
    """Return the evidence for the verdict on a recorded cut, or the fault that allows none."""
    detected = comparison.detected
    return _fault_text(comparison) if detected.verdict == "cannot tell" else _energy_text(detected.energy_ratio)


def _fault_text(comparison: CutComparison) -> str:
    """Return the fault and its remedy, with the numbers of this cut."""
    detected = comparison.detected
    finding, remedy = FAULTS[detected.reason]
    match detected.reason:
        case "speed-not-found" if math.isfinite(detected.distant_rpm):
            finding = f"{finding} (the lines fit {detected.distant_rpm:.0f} rpm)"
        case "teeth-contradicted":
            finding = f"the spindle harmonics are those of {detected.comb_teeth} flutes"
        case "tacho-contradicts":
            finding, remedy = _speed_conflict(comparison)
        case "slow-sampling":
            remedy = (
                f"Use a sample rate of {2 * MIN_TOOTH_HARMONICS * comparison.tooth_passing_frequency:.0f} Hz or more"
            )
        case "overload" if comparison.sensor == "microphone":
            finding, remedy = "the recording is overloaded", "Hold the microphone or phone further away"
        case "unexplained-tone":
            mode, tone = comparison.nearest_mode_frequency(detected.tone), detected.tone
            distance = "" if mode is None else f", {abs(mode - tone):.1f} Hz from the mode at {mode:.1f} Hz,"
            finding = f"the tone at {tone:.1f} Hz{distance} {finding}"
    return join_sentences(finding, remedy)


def _speed_conflict(comparison: CutComparison) -> Fault:
    """Return the fault of a tachometer that contradicts the set speed or the spectrum."""
    detected, set_rpm = comparison.detected, comparison.setting.speed_rpm
    measured, lines = detected.measured_rpm or math.nan, detected.distant_rpm
    source = "the set speed is" if lines == set_rpm else "the spectrum shows"
    finding = f"the tachometer shows {measured:.1f} rpm, but {source} {lines:.1f} rpm"
    if not is_pulse_multiple(measured / lines):
        return Fault(finding, FAULTS["tacho-contradicts"].remedy)
    change = "Multiply" if measured > lines else "Divide"
    return Fault(finding, f"{change} --pulses by {round(max(measured / lines, lines / measured))}, or correct --speed")


def _energy_text(ratio: float) -> str:
    digits = ".2g" if ratio < 1 else ".0f"
    return f"energy outside the spindle harmonics: {100 * ratio:{digits}} % of the energy in the harmonics"


def cut_verdict_text(comparison: CutComparison) -> str:
    """Return the verdict on a recorded cut, with the chatter frequency or the fault."""
    label = cut_verdict_label(comparison)
    return f"{label}: {_fault_text(comparison)}" if comparison.detected.verdict == "cannot tell" else label


def cut_verdict_label(comparison: CutComparison) -> str:
    """Return the verdict on a recorded cut in a few words, with the chatter frequency or the code of the fault."""
    heard, chatter = comparison.detected, comparison.detected.chatter
    if heard.verdict == "cannot tell":
        return f"cannot tell ({heard.reason})"
    if chatter is None:
        return "stable"
    named = "period-two chatter" if heard.verdict == "flip" else "chatter"
    return f"{named} at {chatter.frequency:.1f} +- {max(2 * chatter.error, 0.1):.1f} Hz"


def recorded_cut_texts(comparison: CutComparison) -> list[str]:
    """Return the verdict on a recorded cut, and its evidence."""
    detected = comparison.detected
    texts = [cut_verdict_text(comparison), *parts_texts(detected.part_verdicts)]
    if detected.spindle_speed is not None:
        set_rpm = comparison.setting.speed_rpm
        off = 100 * (comparison.speed_rpm / set_rpm - 1)
        duration = math.nan if detected.spectrum is None else 1 / detected.spectrum.bin_width
        texts.append(
            f"{comparison.speed_rpm:.1f} rpm ({off:+.2f} % from the set {set_rpm:g} rpm), tooth passing "
            f"{comparison.tooth_passing_frequency:.1f} Hz, {duration:.2f} s evaluated"
        )
    if (measured := detected.measured_rpm) is not None:
        texts.append(f"tachometer: {'no speed during the cut' if math.isnan(measured) else f'{measured:.1f} rpm'}")
    if math.isfinite(detected.energy_ratio):
        texts.append(_energy_text(detected.energy_ratio))
    if detected.chatter is not None:
        lobe = comparison.lobe_number
        texts.append(
            f"lobe {lobe} ({lobe} full chatter waves per tooth passing), {len(detected.chatter.peaks)} side bands"
        )
    if comparison.sensor == "microphone":
        texts.append(MICROPHONE_NOTE)
    if comparison.air_from:
        texts.append(f"air taken from {comparison.air_from}, a cut at the same speed")
    if comparison.power is not None:
        texts.append(power_text(comparison.power, comparison.setting.cut))
    return [*texts, *_prediction_texts(comparison), *remark_lines(recorded_cut_remarks(comparison))]


def _prediction_texts(comparison: CutComparison) -> Iterator[str]:
    """Return the prediction from tap tests, and its difference from the detected chatter frequency."""
    expected, difference = comparison.predicted, comparison.frequency_difference
    if expected is not None:
        word = "stable" if expected.stable else "chatter"
        yield f"predicted from tap tests (not rotating): {word}, {expected.frequency:.1f} Hz at this depth"
        if difference is not None:
            yield f"predicted and detected frequency differ by {difference:.1f} Hz (modulo tooth passing)"


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
        "air_from": comparison.air_from or None,
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
        **parts_json(comparison),
    }


def recording_json(comparisons: Sequence[CutComparison], more: Sequence[Mapping[str, Any]] = ()) -> JsonObject:
    """Return the cut in a recording, several as a list in `cuts` with the worst `word`; more: further keys of each."""
    cuts = [recorded_cut_json(comparison) for comparison in comparisons]
    for cut, keys in zip(cuts, more, strict=False):
        cut |= {**keys, "remarks": [*cut["remarks"], *keys.get("remarks", ())]}
    if len(cuts) == 1:
        return cuts[0]
    return {"word": find_worst_cut(comparisons).detected.verdict, "cuts": cuts}


def _round_to_mm(depth: float) -> float:
    return round(1e3 * depth, 4)


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
        yield f"{table.name}: {format_rpm(speed)} rpm, {_round_to_mm(depth):g} mm ({number})"
        yield observe_text(folder, table.name, speed, f"{_round_to_mm(depth):g}")
    stable = [tried for tried in depths if tried.stable_depth]
    for tried in stable:
        chatter = f", chatter at {_round_to_mm(tried.chatter_depth):g} mm" if math.isfinite(tried.chatter_depth) else ""
        place = f"{_round_to_mm(tried.stable_depth):g} mm at {format_rpm(tried.speed_rpm)} rpm"
        yield f"Recommended after {count_noun(len(tried.cuts), 'cut')}: {place}, stable{chatter}"
    if not stable:
        yield "No recommended depth yet: no test cut in a pocket was stable"


def observe_text(folder: Path, program: str, speed: float, depth: str) -> str:
    """Return the command that enters the result of a test cut."""
    observe = shlex.join(["lobewatch", "observe", str(folder), "--program", program])
    return f"Enter the result: {observe} --speed {speed:g} --depth {depth} --stable (or --chatter --frequency HZ)"


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
        yield f"{program.name}: {format_rpm(cut.speed_rpm)} rpm, {depth} mm ({number})"
        risk = chance_text(cut.chatter_probability)
        yield f"Chance of chatter at speed: {risk}, {_suggestion_reason(cut, learning)}"
        yield observe_text(folder, program.name, cut.speed_rpm, depth)
        if program.feed_per_tooth_mm is not None:
            yield "Add --power KW if the drive shows its power. lobewatch computes Kt from the power."
    best = _best_stable_cut(learning)
    if best is not None:
        gain = f", expected gain of the next test cut {100 * cut.gain:.0f} %" if cut and math.isfinite(cut.gain) else ""
        yield f"Best stable test cut: {1e3 * best[1]:.4g} mm at {format_rpm(best[0])} rpm{gain}"
    yield "A test cut may chatter. For safe settings run lobewatch check."


def _suggestion_reason(cut: Suggestion, learning: LearningResult) -> str:
    if cut.repeats:
        is_accepted = cut.repeats in [made.id for made in learning.accepted_cuts]
        return f"the cut repeats {cut.repeats}, which {'may be wrong' if is_accepted else 'contradicts the other cuts'}"
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
