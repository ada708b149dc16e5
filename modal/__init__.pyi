"""Modal analysis: natural frequencies, damping ratios and stiffnesses from an FRF."""

from .bands.extract_modes import extract_modes
from .bands.extraction import Extraction, FittedBand, candidate_frequencies, stabilisation_charts
from .bands.find_resonances import ConjugateError
from .edit_modes import edit_modes
from .fit_modes import decay_spectra, fit_common_modes, fit_decays, fit_modes, modes_from_decays, modes_from_extraction
from .frequency_series import HitChangeKind
from .frf_peaks import find_peaks_above_band, find_truncated_peaks, mode_indicator, pick_peaks
from .hit_changes import HitChange, find_hit_changes
from .mode_shapes import FrfAgreement, ModeShape, average_points, compare_frfs, fit_mode_shapes, mac_matrix
from .modes.match_modes import ModeMatch, follow_mode, mac, match_modes, predominant_mode
from .modes.measurement_effects import (
    CommonDelay,
    MassLoading,
    common_decay_rate,
    common_delay,
    mass_loading,
    remove_window,
    widen_for_window,
    with_mass_uncertainty,
)
from .modes.mode import Mode, synthesize_frf
from .modes.mode_edits import ModeEdits, parse_mode_edits
from .modes.response_delay import find_delay
from .poles import PhysicalPoles, StabilisationChart, fit_lscf_poles, select_physical_poles
from .quality.trust import CredibleModes, Trust, assess_trust, select_credible_modes, trust_rules
from .quality.unexplained_peaks import UnexplainedPeak, find_unexplained_peaks
from .tip_compliance import PartShare, compliance_shares

__all__ = [
    "CommonDelay",
    "ConjugateError",
    "CredibleModes",
    "Extraction",
    "FittedBand",
    "FrfAgreement",
    "HitChange",
    "HitChangeKind",
    "MassLoading",
    "Mode",
    "ModeEdits",
    "ModeMatch",
    "ModeShape",
    "PartShare",
    "PhysicalPoles",
    "StabilisationChart",
    "Trust",
    "UnexplainedPeak",
    "assess_trust",
    "average_points",
    "candidate_frequencies",
    "common_decay_rate",
    "common_delay",
    "compare_frfs",
    "compliance_shares",
    "decay_spectra",
    "edit_modes",
    "extract_modes",
    "find_delay",
    "find_hit_changes",
    "find_peaks_above_band",
    "find_truncated_peaks",
    "find_unexplained_peaks",
    "fit_common_modes",
    "fit_decays",
    "fit_lscf_poles",
    "fit_mode_shapes",
    "fit_modes",
    "follow_mode",
    "mac",
    "mac_matrix",
    "mass_loading",
    "match_modes",
    "mode_indicator",
    "modes_from_decays",
    "modes_from_extraction",
    "parse_mode_edits",
    "pick_peaks",
    "predominant_mode",
    "remove_window",
    "select_credible_modes",
    "select_physical_poles",
    "stabilisation_charts",
    "synthesize_frf",
    "trust_rules",
    "widen_for_window",
    "with_mass_uncertainty",
]
