"""The spindle as a dynamic-stiffness model: modes, tip response, and bearing stiffness from a measured frequency.

Beams on springs, Euler-Bernoulli or Timoshenko, exact at every frequency. Source: O. Gaber and S. M. Hashemi,
Effects of Machine Tool Spindle Decay on the Stability Lobe Diagram, Shock and Vibration, 2015, without its poles.
"""

from dsm.attachments import Bearing, Joint, LumpedMass
from dsm.calibrate import calibrate
from dsm.calibrate_damping import DampingCalibration, UnreachableDampingError, calibrate_damping
from dsm.calibration import Calibration, UnreachableFrequencyError
from dsm.change_tool import change_tool
from dsm.couple_tool import couple_tool
from dsm.critical_speed import critical_speed
from dsm.damped_modes import DampedModes, damped_modes
from dsm.energy_shares import EnergyShares, energy_shares
from dsm.fit_stiffness import fit_stiffness
from dsm.linearized_stiffness import linearized_stiffness
from dsm.material import MATERIALS, Material
from dsm.modal_stiffness import modal_stiffness
from dsm.mode_shapes import mode_shapes
from dsm.modes import Modes
from dsm.modes_at import modes_at
from dsm.natural_frequencies import natural_frequencies
from dsm.plus_minus import plus_minus
from dsm.receptance import receptance
from dsm.receptance_map import receptance_map
from dsm.segment import Segment
from dsm.spindle import Spindle, Theory
from dsm.spindle_side import SpindleSide, spindle_side
from dsm.spinning_beam import SpinningBeam, SpinningSegment, SpinningSpring
from dsm.spinning_element import spinning_element
from dsm.spinning_frequencies import UnstableSpinError, spinning_frequencies
from dsm.static_stiffness import static_stiffness
from dsm.stiffness_curve import stiffness_curve
from dsm.stiffness_fit import StiffnessFit, StiffnessFitError
from dsm.whirl_map import WhirlMap, whirl_map

__all__ = [
    "MATERIALS",
    "Bearing",
    "Calibration",
    "DampedModes",
    "DampingCalibration",
    "EnergyShares",
    "Joint",
    "LumpedMass",
    "Material",
    "Modes",
    "Segment",
    "Spindle",
    "SpindleSide",
    "SpinningBeam",
    "SpinningSegment",
    "SpinningSpring",
    "StiffnessFit",
    "StiffnessFitError",
    "Theory",
    "UnreachableDampingError",
    "UnreachableFrequencyError",
    "UnstableSpinError",
    "WhirlMap",
    "calibrate",
    "calibrate_damping",
    "change_tool",
    "couple_tool",
    "critical_speed",
    "damped_modes",
    "energy_shares",
    "fit_stiffness",
    "linearized_stiffness",
    "modal_stiffness",
    "mode_shapes",
    "modes_at",
    "natural_frequencies",
    "plus_minus",
    "receptance",
    "receptance_map",
    "spindle_side",
    "spinning_element",
    "spinning_frequencies",
    "static_stiffness",
    "stiffness_curve",
    "whirl_map",
]
