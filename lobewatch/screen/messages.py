"""What goes to the page: the state as JSON text, the curves as one binary message."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from lobewatch.tap.state import Plots, TakenHit, TapState

CURVES = ("time", "force", "acceleration", "frequency", "mean", "last", "coherence", "force_spectrum")


def state_message(state: TapState) -> str:
    """All of a state but its curves, as JSON; numbers that are not finite become null."""
    return json.dumps(
        {
            "kind": state.word.name.lower().replace("_", "-"),
            "word": state.shown_word,
            "title": state.title,
            "device": ", ".join(filter(None, (state.device, state.resumed))),
            "reason": state.reason,
            "good": state.good,
            "wanted": state.wanted,
            "hits": [_hit(hit) for hit in state.hits],
            "mean_change": _finite(state.mean_change),
            "settled": state.settled,
            "levels": [_finite(level) for level in state.levels] if state.levels else None,
            "checks": [{"name": one.name, "passed": one.passed, "text": one.text} for one in state.checks],
            "outcome": state.outcome
            and {
                "light": state.outcome.light,
                "texts": list(state.outcome.texts),
                "next_step": state.outcome.next_step,
            },
        },
        allow_nan=False,
    )


def plots_message(plots: Plots) -> bytes:
    """The curves: length of the header (u32), header as JSON padded to 4 bytes, then float32 values, little-endian.

    The header names each curve with its number of values and gives the usable band.
    """
    curves = {name: values for name in CURVES if (values := getattr(plots, name)) is not None}
    header = json.dumps(
        {"curves": [[name, int(values.size)] for name, values in curves.items()], "band": plots.usable_band}
    ).encode()
    header += b" " * (-len(header) % 4)
    values = [np.asarray(curve, dtype="<f4").tobytes() for curve in curves.values()]
    return b"".join([len(header).to_bytes(4, "little"), header, *values])


def _hit(hit: TakenHit) -> dict[str, Any]:
    return {
        "number": hit.number,
        "good": not hit.flags,
        "verdict": hit.flags.words,
        "peak_force": _finite(hit.peak_force),
        "undone": hit.undone,
    }


def _finite(value: float | None) -> float | None:
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None
