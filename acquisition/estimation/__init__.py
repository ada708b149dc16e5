"""From hits to an averaged FRF."""

from acquisition.estimation.estimate_frf import cross_spectra, estimate_frf, frf_of_spectra
from acquisition.estimation.exponential_window import (
    exponential_window,
    time_after_hit,
    time_of_hit,
    windowed_receptance,
)
from acquisition.estimation.force_noise import force_noise, force_noise_through
from acquisition.estimation.hidden_window import hidden_window
from acquisition.estimation.infer_averages import infer_averages
from acquisition.estimation.recorded_share import recorded_share
from acquisition.estimation.running_mean import RunningMean
from acquisition.estimation.smoothed_lines import is_smoothed
from acquisition.estimation.without_mass import without_mass

__all__ = [
    "RunningMean",
    "cross_spectra",
    "estimate_frf",
    "exponential_window",
    "force_noise",
    "force_noise_through",
    "frf_of_spectra",
    "hidden_window",
    "infer_averages",
    "is_smoothed",
    "recorded_share",
    "time_after_hit",
    "time_of_hit",
    "windowed_receptance",
    "without_mass",
]
