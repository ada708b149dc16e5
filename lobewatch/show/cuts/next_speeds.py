"""Show the next speeds to try by the sound of cuts."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from lobewatch.cuts.learning.next_speed import NextSpeed, NextSpeeds
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.show.cuts.suggested_cuts import observe_text
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table

REASON_TEXTS: Mapping[str, str] = {
    "": "Next speeds to try, best first:",
    "no-verdict": "",
    "stable": "Stable at this speed and depth. Keep this speed, or cut a little deeper to find the limit.",
    "no-chatter-frequency": "No next speed: no cut gave a chatter frequency yet. Record a chattering cut.",
    "no-speed-in-range": "No stable pocket lies between {low} and {high} rpm. Cut less deep.",
    "no-deep-speed": "No speed between {low} and {high} rpm is deep enough. Try again less deep:",
}
"""Sentence for each reason of `NextSpeeds`; empty if the cut itself says what to do."""
MAX_SHOWN_GAIN = 10.0
"""Largest relative depth that is shown as a number."""


def next_speeds_json(found: NextSpeeds) -> JsonObject:
    """Return the next speeds to try, or the code of why there are none."""
    return {
        "next_speeds": [_next_speed_json(speed) for speed in found.speeds],
        "next_reason": found.reason,
        "range_rpm": list(found.range_rpm),
        "contradicting_rpm": [cut.speed_rpm for cut in found.contradicting],
    }


def _next_speed_json(found: NextSpeed) -> JsonObject:
    return {
        "speed_rpm": found.speed_rpm,
        "depth_mm": round(1e3 * found.depth, 4) if math.isfinite(found.depth) else None,
        "lobe": found.lobe,
        "natural_frequency_hz": found.frequency,
        "relative_depth": found.relative_depth,
        "window_rpm": list(found.window_rpm),
    }


def next_speeds_texts(found: NextSpeeds) -> Texts:
    """Return the next speeds to try as a table, with what to expect; else why there are none."""
    low, high = (format_rpm(round(speed)) for speed in found.range_rpm)
    sentence = REASON_TEXTS[found.reason].format(low=low, high=high)
    texts: Texts = [*_contradiction_lines(found), *filter(None, [sentence])]
    if not found.speeds:
        return texts
    table = new_table("speed (rpm)", f"depth ({LENGTH.unit})", "stable depth / here", "pocket (rpm)", "waves per flute")
    for speed in found.speeds:
        depth = (
            LENGTH.number(LENGTH.round_down(1e3 * speed.depth), ".4g") if math.isfinite(speed.depth) else "as before"
        )
        first, last = (format_rpm(round(edge)) for edge in speed.window_rpm)
        row = format_rpm(speed.speed_rpm), depth, _gain_text(speed.relative_depth), f"{first}..{last}", f"{speed.lobe}"
        table.add_row(*row)
    return [*texts, table]


def untapped_json(setting: CutSetting, found: NextSpeeds) -> JsonObject:
    """Return the next cut of a program whose tool was never tapped, and all next speeds; its own cut comes first."""
    following = _next_cut(setting, found)
    suggested = following and {"speed_rpm": following[0], "depth_mm": round(1e3 * following[1], 4)}
    return {"program": setting.program, "suggested": suggested, **next_speeds_json(found)}


def untapped_texts(setting: CutSetting, found: NextSpeeds, folder: Path) -> Texts:
    """Return the next cut of a program whose tool was never tapped, and how to enter its result."""
    texts = [
        f"{setting.program}: tool {setting.tool!r} was never tapped, so only its test cuts count.",
        *next_speeds_texts(found),
    ]
    following = _next_cut(setting, found)
    if following is not None:
        texts.append(observe_text(folder, str(setting.program), following[0], 1e3 * following[1]))
    return texts


def _next_cut(setting: CutSetting, found: NextSpeeds) -> tuple[float, float] | None:
    """Return speed (rpm) and depth (m) of the next cut; that of the program before any chatter, or None."""
    if found.speeds:
        return found.speeds[0].speed_rpm, found.speeds[0].depth
    return (setting.speed_rpm, setting.depth) if found.reason in ("no-verdict", "no-chatter-frequency") else None


def _gain_text(gain: float) -> str:
    return f"{gain:.1f}" if gain < MAX_SHOWN_GAIN else f"{MAX_SHOWN_GAIN:g} or more"


def _contradiction_lines(found: NextSpeeds) -> Iterator[str]:
    if found.contradicting:
        speeds = ", ".join(dict.fromkeys(format_rpm(round(cut.speed_rpm)) for cut in found.contradicting))
        count = count_noun(len(found.contradicting), "cut")
        yield f"Not counted: {count} at {speeds} rpm, contradicted by a cut that chattered."
