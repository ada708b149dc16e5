"""Settings that are safe, as JSON objects and in words."""

from __future__ import annotations

import math
from typing import Any

from lobewatch.verdicts import Setting
from lobewatch.verdicts.setting_search import LEFT


def setting_json(setting: Setting | None) -> dict[str, Any] | None:
    """One setting."""
    if setting is None:
        return None
    return {
        "speed_rpm": setting.speed_rpm,
        "depth_mm": setting.depth_mm,
        "window_rpm": list(setting.window_rpm),
        "depth_margin": setting.depth_margin,
        "frequency_left": setting.frequency_left,
    }


def rpm(speed: float) -> str:
    """A speed in groups of three digits."""
    return f"{speed:,.10g}".replace(",", " ")


def spare(setting: Setting) -> str:
    """How far a setting is from what is not safe; all of it rounded towards it."""
    low, high = setting.window_rpm
    margin = f"{math.floor(100 * setting.depth_margin + 1e-6)} % of depth to spare"
    return f"({rpm(low)} to {rpm(high)} rpm is safe; {margin}; {_left(setting.frequency_left)})"


def _left(fall: float) -> str:
    if fall <= 0:
        return f"f_n may fall by less than {100 * LEFT[1]:g} %"
    return f"f_n may fall by {100 * fall:.3g} %" + (" or more" if fall >= LEFT[-1] else "")
