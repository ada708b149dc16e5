"""How a series of tap tests decays: points, alarm, forecast; arrays in, records out."""

from .light import Light
from .standing import SeriesStanding, Standing

__all__ = [
    "Light",
    "SeriesStanding",
    "Standing",
]
