"""From modes or FRFs to stability lobes, and the history of the lobes of one machine."""

from lobes.average_angle import average_angle
from lobes.cut import Cut
from lobes.history import SldHistory
from lobes.history_file import read_history, write_history
from lobes.intervals import intervals_needed
from lobes.radial_lobes import RadialLobes, radial_lobes
from lobes.spectral_radius import spectral_radius
from lobes.stability_boundary import stability_boundary
from lobes.stability_lobes import Lobe, Minimum, StabilityLobes
from lobes.zero_order import zero_order

__all__ = [
    "Cut",
    "Lobe",
    "Minimum",
    "RadialLobes",
    "SldHistory",
    "StabilityLobes",
    "average_angle",
    "intervals_needed",
    "radial_lobes",
    "read_history",
    "spectral_radius",
    "stability_boundary",
    "write_history",
    "zero_order",
]
