"""From an FRF to natural frequencies, damping ratios and stiffnesses."""

from .bands.extract import extract
from .bands.extraction import Extraction, FittedBand
from .bands.find_resonances import ConjugateError
from .bands.survey import candidates, survey
from .cut_edges import cut_edges
from .edit_modes import edit_modes
from .fit_modes import fit_modes, modes_of
from .fit_points import fit_points
from .free_decays import decay_spectra, fit_decays, modes_of_decays
from .mass_loading import MassLoading, mass_loading, with_mass_doubt
from .mode_indicator import mode_indicator
from .modes.common_decay import common_decay
from .modes.common_delay import CommonDelay, common_delay
from .modes.follow import Followed, follow
from .modes.found_again import found_again
from .modes.mac import mac
from .modes.mode import Mode
from .modes.mode_edits import ModeEdits, parse_edits
from .modes.predominant import predominant
from .modes.synthesize import synthesize
from .pick_peaks import pick_peaks
from .poles import PhysicalPoles, StabilisationChart, physical_poles, stabilise
from .quality.peaks_beyond import peaks_beyond
from .quality.plausible import Believed, believed
from .quality.trust import Trust, trust_of, trust_rules
from .remove_window import remove_window, with_windowed_noise

__all__ = [
    "Believed",
    "CommonDelay",
    "ConjugateError",
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
    "found_again",
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
