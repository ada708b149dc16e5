"""Messages to the page of a tap test or of a cut: its state as JSON text, the curves as one binary message."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.cuts.describe_listened import listened_texts, next_step, reason_text
from lobewatch.tap.listening.cut_state import CutState
from lobewatch.tap.state import Plots, TakenHit, TapState

CURVES = ("time", "force", "acceleration", "frequency", "mean", "last", "coherence", "force_spectrum")
"""Names of the curves of `Plots`, as the page knows them."""


def state_message(state: TapState) -> str:
    """State of a tap test but for its curves, as JSON; numbers that are not finite become null."""
    return json.dumps(
        {
            "kind": state.word.name.lower().replace("_", "-"),
            "word": state.shown_word,
            "title": state.title,
            "direction": state.direction,
            "has_plots": state.plots is not None,
            "device": ", ".join(filter(None, (state.device, state.resumed))),
            "reason": state.reason,
            "good": state.good,
            "wanted": state.wanted,
            "hits": [_hit(hit) for hit in state.hits],
            "mean_change": _finite(state.mean_change),
            "settled": state.settled,
            "levels": [_finite(level) for level in state.levels] if state.levels else None,
            "checks": [{"name": check.name, "passed": check.passed, "text": check.text} for check in state.checks],
            "outcome": state.outcome
            and {
                "light": state.outcome.light,
                "is_early": state.outcome.is_early,
                "texts": list(state.outcome.texts),
                "next_step": state.outcome.next_step,
                "programs": [program._asdict() for program in state.outcome.programs],
            },
            "choices": [choice._asdict() for choice in state.choices],
        },
        allow_nan=False,
    )


def cut_message(state: CutState) -> str:
    """State of a cut that is listened to but for its curves, as JSON; numbers that are not finite become null."""
    return json.dumps(
        {
            "kind": state.word.name.lower().replace("_", "-"),
            "word": state.word.value,
            "title": state.title,
            "device": state.device,
            "saved": state.saved,
            "reason": state.reason if state.comparison is None else reason_text(state.comparison),
            "level": _finite(state.level),
            "left": _finite(state.left),
            "cut_seconds": _finite(state.cut_seconds),
            "heard": None if state.comparison is None else _heard(state.comparison),
        },
        allow_nan=False,
    )


def plots_message(plots: Plots) -> bytes:
    """Message of the curves that there are, with the usable band; see curves_message."""
    curves = {name: values for name in CURVES if (values := getattr(plots, name)) is not None}
    return curves_message(curves, plots.usable_band)


def curves_message(curves: Mapping[str, NDArray[np.float64]], band: tuple[float, float] | None = None) -> bytes:
    """Message of curves: length of the header (u32), JSON header padded to 4 bytes, float32 values, little-endian.

    The header names each curve with its number of values and gives the usable band.
    """
    named = [[name, int(values.size)] for name, values in curves.items()]
    header = json.dumps({"curves": named, "band": band}).encode()
    header += b" " * (-len(header) % 4)
    values = [np.asarray(curve, dtype="<f4").tobytes() for curve in curves.values()]
    return b"".join([len(header).to_bytes(4, "little"), header, *values])


def _hit(hit: TakenHit) -> dict[str, Any]:
    return {
        "number": hit.number,
        "good": not hit.flags,
        "verdict": hit.flags.words,
        "peak": hit.peak,
        "undone": hit.undone,
    }


def _heard(comparison: CutComparison) -> dict[str, Any]:
    chatter = comparison.heard.chatter
    return {
        "chatter_frequency_hz": None if chatter is None else chatter.frequency,
        "speed_rpm": None if comparison.heard.turning is None else comparison.speed_rpm,
        "texts": [text for text in listened_texts(comparison)[1:] if text != reason_text(comparison)],
        "next_step": next_step(comparison),
    }


def _finite(value: float | None) -> float | None:
    """Four figures of a number; None where it is none."""
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None
