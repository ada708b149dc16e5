"""Natural modes, none missed: frequencies, shapes, energy, damping, whirl."""

from dsm.modes.critical_speed import critical_speed
from dsm.modes.damped_modes import DampedModes, damped_modes
from dsm.modes.damped_shaft import DampedMode, DampedShaft
from dsm.modes.energy_shares import EnergyShares, energy_shares
from dsm.modes.find_modes import find_modes
from dsm.modes.modal_stiffness import modal_stiffness
from dsm.modes.mode_shapes import mode_shapes
from dsm.modes.modes import Modes
from dsm.modes.modes_at import modes_at
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.modes.whirl_map import WhirlMap, whirl_map

__all__ = [
    "DampedMode",
    "DampedModes",
    "DampedShaft",
    "EnergyShares",
    "Modes",
    "WhirlMap",
    "critical_speed",
    "damped_modes",
    "energy_shares",
    "find_modes",
    "modal_stiffness",
    "mode_shapes",
    "modes_at",
    "natural_frequencies",
    "whirl_map",
]
