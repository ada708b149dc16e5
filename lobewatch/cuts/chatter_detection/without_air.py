"""Evaluate cuts recorded without air before or after them, if the verdict does not need air.

Air shows which tones are there without a cut. Chatter with enough side bands needs no such proof. Nor does a stable cut
whose only peaks are harmonics of the spindle, mostly of tooth passing. All other recordings need air ("no-air").
"""

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection.cut_detection import MAX_CUT_TIME, MIN_CUT_TIME, CutParts
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_cut
from lobewatch.cuts.chatter_detection.cut_windows import NOTHING_KNOWN, KnownCut
from lobewatch.cuts.chatter_detection.peak_classification import MIN_SIDEBANDS, MIN_TOOTH_HARMONICS
from lobewatch.cuts.chatter_detection.window_evaluation import evaluate_windows

AIR_REASONS = ("no-air", "no-cut")
"""Reasons without a verdict of a recording that may hold nothing but a cut."""
MIN_TOOTH_SHARE = 0.5
"""Smallest share of tooth passing in the energy of the spindle harmonics of a cut; chosen, as idling shows run-out."""

STEADY_PIECE_LENGTH, MIN_STEADY_POWER = 0.1, 0.1
"""Length of the pieces (s) of a recording of nothing but a cut, and least power of one over that of the loudest."""


def evaluate_without_air(recording: CutRecording, found: list[CutEvaluation]) -> list[CutEvaluation]:
    """Evaluate a recording of nothing but a cut; the evaluations found with air if it has any."""
    if len(found) > 1 or found[0].reason not in AIR_REASONS:
        return found
    return [_evaluate_whole(recording, found[0])]


def _evaluate_whole(recording: CutRecording, found: CutEvaluation) -> CutEvaluation:
    """Evaluate all windows of a recording as one cut; return the first evaluation if the verdict needs air."""
    signal = np.atleast_2d(np.asarray(recording.signal, dtype=np.float64))
    rate, count = recording.sample_rate, signal.shape[1]
    first = max(count - round(MAX_CUT_TIME * rate), 0)
    clipped = recording.clipped is not None and bool(np.any(recording.clipped))
    if count < MIN_CUT_TIME * rate or clipped or recording.lost_scans or not _is_steady(signal, rate):
        return found
    _, _, teeth, immersion, commanded_rpm, *_ = recording
    whole = CutParts("", slice(0, 0), slice(first, count), 0.0, count / rate, first / rate, count / rate)

    def evaluate(place: slice, known: KnownCut) -> CutEvaluation:
        cut = signal[:, place]
        heard = evaluate_cut(cut, np.zeros(cut.shape), rate, teeth, immersion, commanded_rpm, known=known)
        if heard.verdict != "cannot tell" and not _needs_no_air(heard):
            heard = heard._replace(verdict="cannot tell", reason="no-air", chatter=None)
        return heard._replace(parts=whole._replace(cut=place))

    heard = evaluate_windows(evaluate, signal, whole, rate, NOTHING_KNOWN)
    if heard.verdict == "cannot tell":
        return found._replace(reason="no-air") if heard.spindle_speed is not None else found
    return heard


def _is_steady(signal: Floats, sample_rate: float) -> bool:
    """Return whether all axes are about as loud throughout, shape (axes, n)."""
    size = round(STEADY_PIECE_LENGTH * sample_rate)
    pieces = signal[:, : signal.shape[1] // size * size].reshape(len(signal), -1, size)
    power = np.var(pieces, axis=2)
    return bool(np.all(np.min(power, axis=1) > MIN_STEADY_POWER * np.max(power, axis=1)))


def _needs_no_air(heard: CutEvaluation) -> bool:
    """Return whether a verdict without air is certain: cut by tooth passing, chatter by its side bands."""
    if heard.peaks is None:
        return False
    power, tooth = heard.peaks.comb.amplitude**2, heard.peaks.tooth_order == 0
    if heard.chatter is not None and len(heard.chatter.peaks) < MIN_SIDEBANDS:
        return False
    is_cut = np.count_nonzero(tooth) >= MIN_TOOTH_HARMONICS
    return bool(is_cut and np.sum(power[tooth]) >= MIN_TOOTH_SHARE * np.sum(power))
