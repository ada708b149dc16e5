"""What a light is called and looks like; an early alarm unlike one that is past a limit."""

from __future__ import annotations

from lobewatch.decay.light import Light

LIGHTS = {Light.ALARM: "✗ ALARM", Light.UNKNOWN: "? UNKNOWN", Light.WARN: "! WARNING", Light.GOOD: "✓ GOOD"}
EARLY = "✗ EARLY ALARM"
KINDS = {Light.GOOD: "ok", Light.ALARM: "bad"}
"""Class of a light in the style sheet; the others are doubtful."""


def light_word(light: Light, is_early: bool = False) -> str:
    """The light with its symbol."""
    return EARLY if is_early else LIGHTS[light]


def light_kind(light: Light, is_early: bool = False) -> str:
    """Class of the light in the style sheet."""
    return "early" if is_early else KINDS.get(light, "doubt")
