"""A cut that was listened to, for people and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lobewatch.cuts.listening.measured_speed import is_multiple
from lobewatch.cuts.listening.sorted_lines import TOOTH_HARMONICS
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.programs.describe_power import power_json, power_text

WHY: Mapping[str, str] = {
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
"""Fault and cure by the reason why it cannot be told."""


DEAF = (
    "by microphone: it hears the shop too, so that a tone of another machine that runs in the cut alone is not known "
    "from one of the cut, and it does not tell how far the tool moves"
)
"""What a microphone cannot tell."""
SLOWEST = 2 * TOOTH_HARMONICS
"""Sample rate over tooth passing from which on enough multiples are below half of it."""


NEXT: Mapping[str, str] = {
    "stable": "lobewatch suggest names the next test cut; a deeper one teaches more",
    "chatter": "cut less deep or at another speed; lobewatch suggest names the next test cut",
    "flip": "cut at another speed, or less deep; lobewatch suggest names the next test cut",
    "cannot tell": "listen again; this one teaches nothing",
}
"""Next step by the word."""


def next_step(comparison: CutComparison) -> str:
    """The next step, in a line."""
    return NEXT[comparison.heard.word]


def reason_text(comparison: CutComparison) -> str:
    """What the word rests on, or why it cannot be told, in a line."""
    heard = comparison.heard
    return _why(comparison) if heard.word == "cannot tell" else _energy(heard.ratio)


def _why(comparison: CutComparison) -> str:
    """Fault and cure, with the numbers of this cut."""
    reason, tone = comparison.heard.reason, comparison.heard.tone
    if reason == "speed-not-found" and math.isfinite(comparison.heard.elsewhere_rpm):
        return f"{WHY[reason]}; these lines fit {comparison.heard.elsewhere_rpm:.0f} rpm"
    if reason == "tacho-contradicts":
        return f"{WHY[reason]}: {_other_speed(comparison)}"
    if reason == "slow-sampling":
        return f"{WHY[reason]}: {SLOWEST * comparison.tooth_frequency:.0f} Hz or more"
    if reason == "unexplained-tone":
        mode = comparison.nearest_mode(tone)
        away = "" if mode is None else f", {abs(mode - tone):.1f} Hz from the mode at {mode:.1f} Hz"
        return f"at {tone:.1f} Hz{away}: {WHY[reason]}"
    return WHY[reason]


def _other_speed(comparison: CutComparison) -> str:
    """Both speeds, and what is to be looked at."""
    heard, set_rpm = comparison.heard, comparison.setting.speed_rpm
    measured, lines = heard.measured_rpm or math.nan, heard.elsewhere_rpm
    both = f"{measured:.1f} rpm, not the {lines:.1f} rpm that {'was set' if lines == set_rpm else 'the lines fit'}"
    if not is_multiple(measured / lines):
        return f"{both}; correct --speed, or name the column that is meant"
    size = "small" if measured > lines else "large"
    return f"{both}; --pulses is {round(max(measured / lines, lines / measured))} times too {size}, or correct --speed"


def _energy(ratio: float) -> str:
    percent = f"{100 * ratio:.2g}" if ratio < 1 else f"{100 * ratio:.0f}"
    return f"beside the lines of the spindle: {percent} % of their energy"


def listened_text(comparison: CutComparison) -> str:
    """The word, in a line."""
    heard, chatter = comparison.heard, comparison.heard.chatter
    if heard.word == "cannot tell":
        return f"cannot tell ({heard.reason}): {_why(comparison)}"
    if chatter is None:
        return "stable"
    named = "period-two chatter" if heard.word == "flip" else "chatter"
    return f"{named} at {chatter.frequency:.1f} +- {max(2 * chatter.error, 0.1):.1f} Hz"


def listened_texts(comparison: CutComparison) -> list[str]:
    """The word, and what it rests on."""
    heard, chatter, texts = comparison.heard, comparison.heard.chatter, [listened_text(comparison)]
    if heard.turning is not None:
        off = 100 * (comparison.speed_rpm / comparison.setting.speed_rpm - 1)
        texts.append(
            f"{comparison.speed_rpm:.1f} rpm ({off:+.2f} % of {comparison.setting.speed_rpm:g}), tooth passing "
            f"{comparison.tooth_frequency:.1f} Hz; listened to {_seconds(comparison):.2f} s"
        )
    if heard.measured_rpm is not None:
        is_silent = math.isnan(heard.measured_rpm)
        texts.append(f"tachometer: {'no speed in the cut' if is_silent else f'{heard.measured_rpm:.1f} rpm'}")
    if math.isfinite(heard.ratio):
        texts.append(_energy(heard.ratio))
    if chatter is not None:
        lobe = comparison.lobe
        texts.append(f"lobe {lobe} ({lobe} whole waves between two teeth), {len(chatter.lines)} side bands")
    if comparison.sensor == "microphone":
        texts.append(DEAF)
    if comparison.power is not None:
        texts.append(power_text(comparison.power, comparison.setting.cut))
    return texts + _expected(comparison)


def cuts_texts(comparisons: Sequence[CutComparison], saved: Sequence[str] = ()) -> list[str]:
    """What was heard of each cut in a recording; saved: names under which they are kept."""
    texts = list[str]()
    for number, comparison in enumerate(comparisons):
        parts = comparison.heard.parts
        head = [f"cut {number + 1} of {len(comparisons)}, {parts.begin:.2f} to {parts.end:.2f} s:"]
        texts += head if len(comparisons) > 1 else []
        texts += [*listened_texts(comparison), *(f"saved {name}" for name in saved[number : number + 1])]
    return texts


def _expected(comparison: CutComparison) -> list[str]:
    if comparison.predicted is None:
        return []
    word = "stable" if comparison.predicted.stable else "chatter"
    text = f"by the tap tests, at rest: {word}, at this depth {comparison.predicted.frequency:.1f} Hz"
    if comparison.apart is not None:
        text += f", {comparison.apart:.1f} Hz from what was heard modulo tooth passing"
    return [text]


def _seconds(comparison: CutComparison) -> float:
    spectrum = comparison.heard.spectrum
    return math.nan if spectrum is None else 1 / spectrum.bin


def listened_json(comparison: CutComparison) -> dict[str, Any]:
    """A cut with all that was heard of it."""
    heard, chatter, expected = comparison.heard, comparison.heard.chatter, comparison.predicted
    return {
        "word": heard.word,
        "reason": heard.reason,
        "chatter_frequency_hz": None if chatter is None else chatter.frequency,
        "chatter_frequency_hz_std": None if chatter is None else chatter.error,
        "elsewhere_rpm": heard.elsewhere_rpm,
        "unexplained_tone_hz": heard.tone,
        "sensor": comparison.sensor,
        "speed_rpm": heard.speed_rpm,
        "speed_rpm_std": None if heard.turning is None else 60 * heard.turning.error,
        "commanded_rpm": comparison.setting.speed_rpm,
        "measured_rpm": heard.measured_rpm,
        "depth_mm": 1e3 * comparison.setting.depth,
        "tooth_frequency_hz": comparison.tooth_frequency,
        "energy_ratio": heard.ratio,
        "lobe": comparison.lobe,
        "side_bands_hz": [] if chatter is None else sorted(chatter.lines.frequency.tolist()),
        **power_json(comparison.power),
        "predicted": None if expected is None else ("stable" if expected.stable else "chatter"),
        "predicted_frequency_hz": None if expected is None else expected.frequency,
        "predicted_apart_hz": comparison.apart,
        "begin_s": heard.parts.begin,
        "end_s": heard.parts.end,
        "steady_begin_s": heard.parts.steady_begin,
        "steady_end_s": heard.parts.steady_end,
    }


def cuts_json(comparisons: Sequence[CutComparison], beside: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """The cut in a recording; several stand in `cuts`. beside: more of each."""
    each = [listened_json(comparison) for comparison in comparisons]
    for cut, more in zip(each, beside, strict=False):
        cut.update(more)
    return each[0] if len(each) == 1 else {"cuts": each}
