"""Evaluation of a cut with its evidence."""

from typing import NamedTuple

import numpy as np

from lobewatch.cuts.chatter_detection.cut_detection import WHOLE_SIGNAL, CutParts
from lobewatch.cuts.chatter_detection.load_ripple import Ripple
from lobewatch.cuts.chatter_detection.peak_classification import ChatterPeaks, PeaksByOrigin
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, Spectrum
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed
from lobewatch.machine.journal.entries import CutVerdict, PartVerdict


class CutEvaluation(NamedTuple):
    """Evaluation of one cut in a recording with its evidence; None and NaN for steps that were not reached."""

    verdict: CutVerdict
    """Verdict on the cut."""
    reason: str
    """Code of the reason why there is no verdict; empty with a verdict."""
    parts: CutParts = WHOLE_SIGNAL
    """Parts of the recording: cut and air."""
    spindle_speed: SpindleSpeed | None = None
    """True spindle speed."""
    energy_ratio: float = np.nan
    """Energy of unexplained peaks at the end of the cut over that of the spindle harmonics."""
    chatter: ChatterPeaks | None = None
    """Chatter peaks."""
    peaks: PeaksByOrigin | None = None
    """All peaks by origin."""
    spectrum: Spectrum | None = None
    """Spectrum of the cut."""
    distant_rpm: float = np.nan
    """Speed far from the commanded one that fits the peaks (rpm); NaN if there is none or a near one fits."""
    tone: float = np.nan
    """Frequency of an unexplained tone (Hz); NaN unless that is the reason."""
    comb_teeth: int = 0
    """Number of teeth by the harmonics; 0 unless it contradicts the stated one."""
    axis: int = 0
    """Index of the axis that the verdict rests on."""
    measured_rpm: float | None = None
    """Tachometer speed in the cut (rpm), NaN without pulses there; None without a tachometer."""
    part_verdicts: tuple[PartVerdict, ...] = ()
    """Verdicts on the parts of the cut in turn, from the beginning of the recording; empty without a cut."""
    ripple: Ripple | None = None
    """Ripple of loudness or speed; None if the cut is steady."""

    @property
    def speed_rpm(self) -> float:
        """True spindle speed (rpm); NaN if not found."""
        return np.nan if self.spindle_speed is None else 60 * self.spindle_speed.frequency


def group_peaks(sound: CutEvaluation) -> dict[str, SpectralPeaks]:
    """Group the peaks by "turns" of the spindle, "tooth" passing, "air" and "chatter"; empty groups are left out."""
    peaks, chatter = sound.peaks, sound.chatter
    named: dict[str, SpectralPeaks] = {}
    if peaks is not None:
        tooth = peaks.tooth_order == 0
        named = {"turns": peaks.comb[~tooth], "tooth": peaks.comb[tooth], "air": peaks.air}
    if chatter is not None:
        named["chatter"] = chatter.peaks
    return {name: kind for name, kind in named.items() if len(kind)}


def rank_evidence(sound: CutEvaluation) -> tuple[bool, float]:
    """Rank an evaluation of an axis or a window: chatter first, then by energy."""
    peaks = sound.chatter.peaks if sound.chatter else sound.peaks and sound.peaks.comb
    return sound.chatter is not None, peaks.energy if peaks else 0.0


def is_beyond_ripple(sound: CutEvaluation) -> bool:
    """Return whether most of the energy of chatter is where the ripple of a stable cut puts nothing."""
    if sound.chatter is None or sound.spectrum is None or sound.spindle_speed is None or sound.ripple is None:
        return False
    peaks, turn = sound.chatter.peaks, sound.spindle_speed.frequency
    return sound.ripple.energy_beyond(peaks, turn, sound.spectrum.bin_width) > 0.5 * peaks.energy
