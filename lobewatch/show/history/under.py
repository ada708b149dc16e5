"""What a tap test was taken under, for people."""

from __future__ import annotations

from acquisition import Conditions

WORDS = {
    "temperature_c": "{:g} °C",
    "stick_out_mm": "stick-out {:g} mm",
    "drawbar_kn": "drawbar {:g} kN",
    "state": "state {}",
    "reclamped": "clamped anew",
    "note": "note: {}",
}


def conditions_texts(conditions: Conditions) -> list[str]:
    """What is known of it, a few words each."""
    return [words.format(conditions.known[name]) for name, words in WORDS.items() if name in conditions.known]
