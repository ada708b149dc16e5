"""From hits to an averaged FRF."""

from acquisition.estimation.estimate_frf import (
    RunningMean,
    compute_cross_spectra,
    estimate_frf,
    estimate_frf_from_spectra,
    propagate_force_noise,
    propagate_force_noise_through,
)
from acquisition.estimation.frf_corrections import (
    apply_exponential_window,
    correct_windowed_receptance,
    find_hit_time,
    measure_time_after_hit,
    remove_sensor_mass,
)
from acquisition.estimation.infer_processing import infer_averages, infer_recorded_share, infer_window, is_smoothed

__all__ = [
    "RunningMean",
    "apply_exponential_window",
    "compute_cross_spectra",
    "correct_windowed_receptance",
    "estimate_frf",
    "estimate_frf_from_spectra",
    "find_hit_time",
    "infer_averages",
    "infer_recorded_share",
    "infer_window",
    "is_smoothed",
    "measure_time_after_hit",
    "propagate_force_noise",
    "propagate_force_noise_through",
    "remove_sensor_mass",
]
