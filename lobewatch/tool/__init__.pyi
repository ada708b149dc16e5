"""Tool in the spindle: series of tap tests, assembly in x and y, prediction, and lobes."""

from .assembly import DIRECTION_CODES, Assembly, compute_lobes, speed_grid
from .lobe_chart import DynamicsSource, LobeChart, LobeMethod, compute_lobe_chart

__all__ = [
    "DIRECTION_CODES",
    "Assembly",
    "DynamicsSource",
    "LobeChart",
    "LobeMethod",
    "compute_lobe_chart",
    "compute_lobes",
    "speed_grid",
]
