"""Evaluate a cut recorded without air, after the air of an earlier recording."""

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording


def evaluate_with_air(recording: CutRecording, air: Floats, *, is_calibrated: bool) -> list[CutEvaluation]:
    """Evaluate each cut in a recording after air from an earlier recording at the same speed, shape (axes, n).

    is_calibrated: the same sensor has the same sensitivity. Otherwise the noise of the air is made as loud as that of
    the recording, as a microphone may be nearer. Times count from the beginning of the recording.
    """
    axes = np.atleast_2d(np.asarray(recording.signal, dtype=np.float64))
    if not is_calibrated:
        air = air * np.sqrt(_noise_density(axes) / _noise_density(air))[:, np.newaxis]
    count = air.shape[1]
    longer = recording._replace(
        signal=np.concatenate([air, axes], axis=1),
        clipped=None if recording.clipped is None else np.pad(recording.clipped, (count, 0)),
        measured_rpm=None
        if recording.measured_rpm is None
        else np.pad(recording.measured_rpm, (count, 0), mode="edge"),
    )
    return [_shift_times(sound, count / recording.sample_rate) for sound in evaluate_recording(longer)]


def _noise_density(signal: Floats) -> Floats:
    """Return the median noise power in a bandwidth that does not depend on the length of a signal, shape (axes,)."""
    spectra = spectral.compute_spectra(signal, 1.0)
    return np.array([np.median(spectrum.noise) / spectrum.bin_width for spectrum in spectra])


def _shift_times(sound: CutEvaluation, earlier: float) -> CutEvaluation:
    """Return an evaluation with times in a recording that begins later (s)."""

    def later(time: float) -> float:
        return float(np.maximum(time - earlier, 0.0))

    parts = sound.parts
    steady = later(parts.steady_begin), later(parts.steady_end)
    parts = parts._replace(begin=later(parts.begin), end=later(parts.end), steady_begin=steady[0], steady_end=steady[1])
    part_verdicts = tuple(part.shift(-earlier) for part in sound.part_verdicts)
    return sound._replace(parts=parts, part_verdicts=part_verdicts)
