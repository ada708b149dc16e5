"""The spindle as a dynamic-stiffness model: modes, tip response, and bearing stiffness from a measured frequency.

Beams on springs, Euler-Bernoulli or Timoshenko, exact at every frequency. Source: O. Gaber and S. M. Hashemi,
Effects of Machine Tool Spindle Decay on the Stability Lobe Diagram, Shock and Vibration, 2015, without its poles.
"""

from .calibration.calibrate import calibrate
from .calibration.calibrate_damping import DampingCalibration, UnreachableDampingError, calibrate_damping
from .calibration.calibration import Calibration, UnreachableFrequencyError
from .calibration.fit_stiffness import fit_stiffness
from .calibration.plus_minus import plus_minus, rounded
from .calibration.predict_mode import PredictedMode, predict_mode
from .calibration.preload_left import PreloadLeft, preload_left
from .calibration.receptance_map import receptance_map
from .calibration.stiffness_curve import stiffness_curve
from .calibration.stiffness_fit import StiffnessFit, StiffnessFitError
from .modes.critical_speed import critical_speed
from .modes.damped_modes import DampedModes, damped_modes
from .modes.energy_shares import EnergyShares, energy_shares
from .modes.modal_stiffness import modal_stiffness
from .modes.mode_shapes import mode_shapes
from .modes.modes import Modes
from .modes.modes_at import modes_at
from .modes.natural_frequencies import natural_frequencies
from .modes.whirl_map import WhirlMap, whirl_map
from .response.couple_tool import couple_tool
from .response.linearized_stiffness import linearized_stiffness
from .response.receptance import receptance
from .response.spindle_side import SpindleSide, spindle_side
from .response.static_stiffness import static_stiffness
from .spindle.attachments import Bearing, Joint, LumpedMass
from .spindle.change_tool import change_tool
from .spindle.material import MATERIALS, Material
from .spindle.segment import Segment
from .spindle.spindle import Spindle, Theory
from .spinning.beam import SpinningBeam, SpinningSegment, SpinningSpring
from .spinning.element import spinning_element
from .spinning.frequencies import UnstableSpinError, spinning_frequencies

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
    "PredictedMode",
    "PreloadLeft",
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
    "predict_mode",
    "preload_left",
    "receptance",
    "receptance_map",
    "rounded",
    "spindle_side",
    "spinning_element",
    "spinning_frequencies",
    "static_stiffness",
    "stiffness_curve",
    "whirl_map",
]
