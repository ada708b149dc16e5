"""Show recorded cuts with verdict and evidence."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from acquisition.errors import join_sentences
from lobewatch.cuts.chatter_detection.evaluated_cut import CutEvaluation
from lobewatch.cuts.chatter_detection.peak_classification import MIN_TOOTH_HARMONICS
from lobewatch.cuts.chatter_detection.spindle_speed import is_pulse_multiple
from lobewatch.logbook.cut_comparison import CutComparison, find_worst_cut
from lobewatch.show.cuts.cut_parts import MICROPHONE_NOTE, parts_json, recorded_cut_remarks
from lobewatch.show.programs.materials import power_json, power_text
from lobewatch.show.programs.part_texts import parts_texts
from lobewatch.show.terminal.output import JsonObject, remark_lines


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
    "other-source": Fault(
        "most lines besides tooth passing belong to no chatter, but to music, another machine or a low bit rate",
        "Record the cut alone, as WAV or with 96 kbit/s or more",
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


MAX_SHOWN_ENERGY_RATIO = 10.0
"""Largest energy outside the spindle harmonics over that in them that is shown as a number; chosen."""


def _energy_text(ratio: float) -> str:
    digits = ".2g" if ratio < 1 else ".0f"
    share = f"{100 * ratio:{digits}} % of" if ratio <= MAX_SHOWN_ENERGY_RATIO else "more than 10 times"
    return f"energy outside the spindle harmonics: {share} the energy in the harmonics"


def _evaluated_time(detected: CutEvaluation) -> float:
    """Return the length of all parts of a cut (s), or of the only window."""
    parts = detected.part_verdicts
    if parts:
        return parts[-1].to_s - parts[0].from_s
    return math.nan if detected.spectrum is None else 1 / detected.spectrum.bin_width


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
        texts.append(
            f"{comparison.speed_rpm:.1f} rpm ({off:+.2f} % from the set {set_rpm:g} rpm), tooth passing "
            f"{comparison.tooth_passing_frequency:.1f} Hz, {_evaluated_time(detected):.2f} s evaluated"
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
