"""From an FRF to natural frequencies, damping ratios and stiffnesses."""

from modal.fit_modes import fit_modes
from modal.mode import Mode
from modal.pick_peaks import pick_peaks
from modal.predominant import predominant
from modal.synthesize import synthesize

__all__ = ["Mode", "fit_modes", "pick_peaks", "predominant", "synthesize"]
