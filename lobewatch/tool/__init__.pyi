"""A tool in the spindle as it was tapped: its series, its mounting, x and y together, a prediction, its lobes."""

from .assembly import ABOUT_DIRECTIONS, Assembly, lobes_of, speed_grid
from .charts import Chart, Dynamics, Method, chart

__all__ = [
    "ABOUT_DIRECTIONS",
    "Assembly",
    "Chart",
    "Dynamics",
    "Method",
    "chart",
    "lobes_of",
    "speed_grid",
]
