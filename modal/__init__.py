"""From an FRF to natural frequencies, damping ratios and stiffnesses."""

from modal.bands.extract import extract
from modal.bands.extraction import Extraction, FittedBand
from modal.bands.survey import candidates, survey
from modal.cut_edges import cut_edges
from modal.edit_modes import edit_modes
from modal.fit_modes import fit_modes, modes_of
from modal.fit_points import fit_points
from modal.free_decays import decay_spectra, fit_decays, modes_of_decays
from modal.mass_loading import MassLoading, mass_loading, with_mass_doubt
from modal.mode_indicator import mode_indicator
from modal.modes.common_decay import common_decay
from modal.modes.common_delay import CommonDelay, common_delay
from modal.modes.follow import Followed, follow
from modal.modes.mac import mac
from modal.modes.mode import Mode
from modal.modes.mode_edits import ModeEdits, parse_edits
from modal.modes.predominant import predominant
from modal.modes.synthesize import synthesize
from modal.pick_peaks import pick_peaks
from modal.poles import PhysicalPoles, StabilisationChart, physical_poles, stabilise
from modal.quality.peaks_beyond import peaks_beyond
from modal.quality.plausible import Believed, believed
from modal.quality.trust import Trust, trust_of, trust_rules
from modal.remove_window import remove_window, with_windowed_noise

__all__ = [
    "Believed",
    "CommonDelay",
    "Extraction",
    "FittedBand",
    "Followed",
    "MassLoading",
    "Mode",
    "ModeEdits",
    "PhysicalPoles",
    "StabilisationChart",
    "Trust",
    "believed",
    "candidates",
    "common_decay",
    "common_delay",
    "cut_edges",
    "decay_spectra",
    "edit_modes",
    "extract",
    "fit_decays",
    "fit_modes",
    "fit_points",
    "follow",
    "mac",
    "mass_loading",
    "mode_indicator",
    "modes_of",
    "modes_of_decays",
    "parse_edits",
    "peaks_beyond",
    "physical_poles",
    "pick_peaks",
    "predominant",
    "remove_window",
    "stabilise",
    "survey",
    "synthesize",
    "trust_of",
    "trust_rules",
    "with_mass_doubt",
    "with_windowed_noise",
]
