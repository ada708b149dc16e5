"""From modes or FRFs to stability lobes, advice for cutting programs, and the history of the lobes of one machine."""

from lobes.aged_mode import aged_mode
from lobes.average_angle import average_angle
from lobes.check_program import ProgramCheck, check_program
from lobes.coefficients import Coefficients, cutting_coefficients, tangential_and_radial
from lobes.cut import Cut, Direction
from lobes.cutting_power import deepest_for_drive, mean_torque
from lobes.depth_band import DepthBand, coefficient_range, measurement_band
from lobes.history import SldHistory
from lobes.history_file import read_history, write_history
from lobes.nearest_speed import nearest_speed
from lobes.pockets import Pocket, PocketShift, best_pockets, pocket_shifts, pockets
from lobes.program import Program
from lobes.program_limit import ProgramLimit, program_limit
from lobes.radial_lobes import RadialLobes, radial_lobes
from lobes.spectral_radius import spectral_radius
from lobes.stability_boundary import stability_boundary
from lobes.stability_lobes import Lobe, MethodName, Minimum, StabilityLobes
from lobes.tolerable_decay import tolerable_decay
from lobes.zero_order import zero_order

__all__ = [
    "Coefficients",
    "Cut",
    "DepthBand",
    "Direction",
    "Lobe",
    "MethodName",
    "Minimum",
    "Pocket",
    "PocketShift",
    "Program",
    "ProgramCheck",
    "ProgramLimit",
    "RadialLobes",
    "SldHistory",
    "StabilityLobes",
    "aged_mode",
    "average_angle",
    "best_pockets",
    "check_program",
    "coefficient_range",
    "cutting_coefficients",
    "deepest_for_drive",
    "mean_torque",
    "measurement_band",
    "nearest_speed",
    "pocket_shifts",
    "pockets",
    "program_limit",
    "radial_lobes",
    "read_history",
    "spectral_radius",
    "stability_boundary",
    "tangential_and_radial",
    "tolerable_decay",
    "write_history",
    "zero_order",
]
