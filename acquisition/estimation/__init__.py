"""From hits to an averaged FRF."""

from acquisition.estimation.estimate_frf import cross_spectra, estimate_frf, frf_of_spectra
from acquisition.estimation.force_noise import force_noise
from acquisition.estimation.running_mean import RunningMean

__all__ = [
    "RunningMean",
    "cross_spectra",
    "estimate_frf",
    "force_noise",
    "frf_of_spectra",
]
