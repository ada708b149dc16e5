"""What goes to the page: the state as JSON text, the curves as one binary message."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
            "mean_change": finite(state.mean_change),
            "settled": state.settled,
            "levels": [finite(level) for level in state.levels] if state.levels else None,
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
    """The curves that there are, with the usable band; see curves_message."""
    curves = {name: values for name in CURVES if (values := getattr(plots, name)) is not None}
    return curves_message(curves, plots.usable_band)


def curves_message(curves: Mapping[str, NDArray[np.float64]], band: tuple[float, float] | None = None) -> bytes:
    """Curves: length of the header (u32), header as JSON padded to 4 bytes, then float32 values, little-endian.

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
        "peak_force": finite(hit.peak_force),
        "undone": hit.undone,
    }


def finite(value: float | None) -> float | None:
    """Four figures of a number; None where it is none."""
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None
