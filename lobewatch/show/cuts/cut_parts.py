"""Show the place and the ripple of a recorded cut, and the remarks on it."""

from dataclasses import asdict

from acquisition import Remark
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.terminal.output import JsonObject

MICROPHONE_NOTE = "microphone: other machines may be recorded too, and the vibration of the tool stays unknown"
"""Limits of a recording by microphone."""


def recorded_cut_remarks(comparison: CutComparison) -> list[Remark]:
    """Return the remarks on a recorded cut."""
    ripple = comparison.detected.ripple
    if ripple is None:
        return []
    kinds = [f"loudness by {100 * ripple.loudness:.0f} %"] if ripple.loudness else []
    kinds += [f"speed by {100 * ripple.speed:.2f} %"] if ripple.speed else []
    text = f"the cut ripples at {ripple.frequency:.1f} Hz ({', '.join(kinds)}), which is no chatter"
    cure = "Check ribs, small circles, the ball screw and the drive for this frequency"
    return [Remark("modulated", comparison.setting.program or "reference cut", text, cure)]


def parts_json(comparison: CutComparison) -> JsonObject:
    """Return the place and the parts of a recorded cut, its ripple, and the codes of the remarks on it."""
    heard, ripple = comparison.detected, comparison.detected.ripple
    return {
        "begin_s": heard.parts.begin,
        "end_s": heard.parts.end,
        "steady_begin_s": heard.parts.steady_begin,
        "steady_end_s": heard.parts.steady_end,
        "parts": [asdict(part) for part in heard.part_verdicts],
        "comb_teeth": heard.comb_teeth or None,
        "ripple_hz": ripple and ripple.frequency,
        "loudness_ripple": ripple and ripple.loudness,
        "speed_ripple": ripple and ripple.speed,
        "remarks": [remark.code for remark in recorded_cut_remarks(comparison)],
    }
