"""Dynamic-stiffness model (DSM) of a spindle: modes, tip response and bearing calibration.

Beams on springs, Euler-Bernoulli or Timoshenko, exact at every frequency. Source: O. Gaber and S. M. Hashemi,
Effects of Machine Tool Spindle Decay on the Stability Lobe Diagram, Shock and Vibration, 2015, without its poles.
"""

from .calibration.calibrate import calibrate, stiffness_curve
from .calibration.calibrate_damping import DampingCalibration, UnreachableDampingError, calibrate_damping
from .calibration.calibration import Calibration, RemainingPreload, UnreachableFrequencyError, remaining_preload
from .calibration.fit_result import PredictedMode, StiffnessFit, StiffnessFitError, predict_mode
from .calibration.fit_stiffness import fit_stiffness
from .calibration.receptance_map import receptance_map
from .calibration.report_text import format_rounded, format_with_error
from .modes.damped_modes import DampedModes, damped_modes
from .modes.energy_shares import EnergyShares, energy_shares
from .modes.modes import Modes
from .modes.natural_frequencies import modal_stiffness, mode_shapes, modes_at, natural_frequencies
from .modes.whirl_map import WhirlMap, critical_speed, whirl_map
from .response import SpindleSide, couple_tool, linearized_stiffness, receptance, spindle_side, static_stiffness
from .spindle.attachments import Bearing, Joint, LumpedMass
from .spindle.segment import MATERIALS, Material, Segment
from .spindle.spindle import Spindle, Theory, change_tool
from .spinning.beam import SpinningBeam, SpinningSegment, SpinningSpring, spinning_element
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
    "RemainingPreload",
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
    "format_rounded",
    "format_with_error",
    "linearized_stiffness",
    "modal_stiffness",
    "mode_shapes",
    "modes_at",
    "natural_frequencies",
    "predict_mode",
    "receptance",
    "receptance_map",
    "remaining_preload",
    "spindle_side",
    "spinning_element",
    "spinning_frequencies",
    "static_stiffness",
    "stiffness_curve",
    "whirl_map",
]
