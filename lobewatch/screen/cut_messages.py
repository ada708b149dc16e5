"""What goes to the page of a cut that is listened to."""

from __future__ import annotations

import json
from typing import Any

from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.screen.messages import finite
from lobewatch.show.cuts.describe_listened import listened_texts, next_step, why
from lobewatch.tap.listening.cut_state import CutState


def cut_message(state: CutState) -> str:
    """All of a state but its curves, as JSON; numbers that are not finite become null."""
    return json.dumps(
        {
            "kind": state.word.name.lower().replace("_", "-"),
            "word": state.word.value,
            "title": state.title,
            "device": state.device,
            "saved": state.saved,
            "reason": state.reason if state.found is None else why(state.found),
            "level": finite(state.level),
            "left": finite(state.left),
            "cut_seconds": finite(state.cut_seconds),
            "heard": None if state.found is None else _heard(state.found),
        },
        allow_nan=False,
    )


def _heard(found: CutComparison) -> dict[str, Any]:
    chatter = found.heard.chatter
    return {
        "chatter_frequency_hz": None if chatter is None else chatter.frequency,
        "speed_rpm": None if found.heard.turning is None else found.speed_rpm,
        "texts": [text for text in listened_texts(found)[1:] if text != why(found)],
        "next_step": next_step(found),
    }
