"""From modes or FRFs to stability lobes, and the history of the lobes of one machine."""

from lobes.average_angle import average_angle
from lobes.cut import Cut
from lobes.history import SldHistory
from lobes.history_file import read_history, write_history
from lobes.stability_lobes import Lobe, Minimum, StabilityLobes

__all__ = [
    "Cut",
    "Lobe",
    "Minimum",
    "SldHistory",
    "StabilityLobes",
    "average_angle",
    "read_history",
    "write_history",
]
