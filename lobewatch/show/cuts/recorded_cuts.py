"""Show recorded cuts: verdict, speed and evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lobewatch.cuts.chatter_detection.peak_classification import MIN_TOOTH_HARMONICS
from lobewatch.cuts.chatter_detection.spindle_speed import is_pulse_multiple
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.programs.materials import power_text
from lobewatch.show.terminal.json_fields import json_fields

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
"""Fault and remedy for each reason why chatter cannot be told from a stable cut."""


MICROPHONE_NOTE = (
    "by microphone: it hears the shop too, so that a tone of another machine that runs in the cut alone is not known "
    "from one of the cut, and it does not tell how far the tool moves"
)
"""Limits of a recording by microphone."""
MIN_RATE_FACTOR = 2 * MIN_TOOTH_HARMONICS
"""Sample rate over tooth-passing frequency that holds enough harmonics of tooth passing."""


NEXT_STEP_TEXTS: Mapping[str, str] = {
    "stable": "lobewatch suggest names the next test cut; a deeper one teaches more",
    "chatter": "cut less deep or at another speed; lobewatch suggest names the next test cut",
    "flip": "cut at another speed, or less deep; lobewatch suggest names the next test cut",
    "cannot tell": "listen again; this one teaches nothing",
}
"""Next step for each verdict on a recorded cut."""


def next_step_text(comparison: CutComparison) -> str:
    """Return the next step after a recorded cut."""
    return NEXT_STEP_TEXTS[comparison.detected.verdict]


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
            return f"{text}: {MIN_RATE_FACTOR * comparison.tooth_passing_frequency:.0f} Hz or more"
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
        difference = 100 * (comparison.speed_rpm / comparison.setting.speed_rpm - 1)
        duration = math.nan if detected.spectrum is None else 1 / detected.spectrum.bin_width
        texts.append(
            f"{comparison.speed_rpm:.1f} rpm ({difference:+.2f} % of {comparison.setting.speed_rpm:g}), tooth passing "
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
    return texts + _prediction_texts(comparison)


def recording_texts(comparisons: Sequence[CutComparison], saved: Sequence[str] = ()) -> list[str]:
    """Return what was detected in each cut of a recording; saved: names under which the cuts are kept."""
    texts = list[str]()
    for number, comparison in enumerate(comparisons):
        parts = comparison.detected.parts
        if len(comparisons) > 1:
            texts.append(f"cut {number + 1} of {len(comparisons)}, {parts.begin:.2f} to {parts.end:.2f} s:")
        texts += [*recorded_cut_texts(comparison), *(f"saved {name}" for name in saved[number : number + 1])]
    return texts


def _prediction_texts(comparison: CutComparison) -> list[str]:
    expected, difference = comparison.predicted, comparison.frequency_difference
    if expected is None:
        return []
    apart = "" if difference is None else f", {difference:.1f} Hz from what was heard modulo tooth passing"
    frequency = f"at this depth {expected.frequency:.1f} Hz"
    return [f"by the tap tests, at rest: {_stability_text(expected.stable)}, {frequency}{apart}"]


RECORDED_CUT_FIELDS = json_fields("""
    word=detected.verdict reason=detected.reason chatter_frequency_hz=detected.chatter.frequency
    chatter_frequency_hz_std=detected.chatter.error elsewhere_rpm=detected.distant_rpm
    unexplained_tone_hz=detected.tone sensor speed_rpm=detected.speed_rpm
    speed_rpm_std=detected.spindle_speed.error*60 commanded_rpm=setting.speed_rpm measured_rpm=detected.measured_rpm
    depth_mm=setting.depth*1e3 tooth_frequency_hz=tooth_passing_frequency energy_ratio=detected.energy_ratio
    lobe=lobe_number side_bands_hz=detected.chatter.peaks.frequency power_kw=power.watts/1e3
    tangential_by_power_n_per_mm2=power.tangential/1e6 predicted predicted_frequency_hz=predicted.frequency
    predicted_apart_hz=frequency_difference begin_s=detected.parts.begin end_s=detected.parts.end
    steady_begin_s=detected.parts.steady_begin steady_end_s=detected.parts.steady_end
""")


def recorded_cut_json(comparison: CutComparison) -> dict[str, Any]:
    """Return a recorded cut with all that was detected in it."""
    chatter, expected = comparison.detected.chatter, comparison.predicted
    return RECORDED_CUT_FIELDS(comparison) | {
        "side_bands_hz": [] if chatter is None else sorted(chatter.peaks.frequency.tolist()),
        "predicted": None if expected is None else _stability_text(expected.stable),
    }


def _stability_text(is_stable: bool) -> str:
    return "stable" if is_stable else "chatter"


def recording_json(comparisons: Sequence[CutComparison], more: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """Return the cut in a recording, several as a list in `cuts`; more: further keys of each."""
    cuts = [recorded_cut_json(comparison) for comparison in comparisons]
    for cut, keys in zip(cuts, more, strict=False):
        cut.update(keys)
    return cuts[0] if len(cuts) == 1 else {"cuts": cuts}
