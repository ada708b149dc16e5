"""Reasons why the modes of a tap test do not cover its measurement."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

import modal
from acquisition import Frf, Remark, merge_remarks
from dsm import format_rounded
from lobewatch.machine import Machine
from lobewatch.measurement.hit_remarks import HIT_CHANGE_CODES
from modal import HitChange, Mode, UnexplainedPeak

PEAK_CODE = "peak-not-explained"
"""Code of the remark on a measured peak that the accepted modes do not explain."""
PEAK_REMEDY, PEAK_REMEDY_BESIDE_TIP = "Warm up the spindle, check the clamping, and tap again", "Tap at the tool tip"
"""Remedies of such a peak, at the tool tip and with [tap] position_mm, where one mode goes to the tip."""
UNCOVERED_CODES = (PEAK_CODE, *HIT_CHANGE_CODES.values())
"""Codes of remarks after which no program is stable: only another tap test or better modes end them, no answer does.

To add a reason, put its remark among those of `fit_tap` or `interpret_fit`, about the frequency ("1500 Hz") or empty,
and its code here. Everything else follows: verdicts are at most doubtful, nothing is recommended, and `check`, the
report, the tap test screen and the JSON show the remark.
"""


def find_uncovered(remarks: Iterable[Remark]) -> tuple[Remark, ...]:
    """Return the remarks that say the modes do not cover the measurement."""
    return tuple(remark for remark in remarks if remark.code in UNCOVERED_CODES)


def label_direction(remark: Remark, direction: str) -> Remark:
    """Return a remark of an assembly, about the frequency and the direction of its tap test."""
    return replace(remark, about=f"{remark.about} in {direction}" if remark.about else f"direction {direction}")


def describe_uncovered(remarks: Sequence[Remark]) -> tuple[str, str]:
    """Return the first finding with the subjects of the others, and all remedies."""
    first, *others = merge_remarks(remarks)
    also = ", ".join(dict.fromkeys(remark.about for remark in others if remark.about))
    cures = dict.fromkeys(remark.cure for remark in remarks if remark.cure)
    return first.finding + (f", also {also}" if also else ""), ". ".join(cures)


def peak_remark(peak: UnexplainedPeak, cure: str = PEAK_REMEDY) -> Remark:
    """Return the remark on a measured peak that the modes do not explain."""
    measured, explained = (f"{format_rounded(value, scale=1e-6, digits=2)} um/N" for value in peak[1:3])
    found = f"most negative real part {measured} instead of {explained}"
    return Remark(
        PEAK_CODE, f"{peak.frequency:.0f} Hz", f"peak not explained by the modes used for lobes, {found}", cure
    )


def _is_of_change(peak: UnexplainedPeak, changes: Sequence[HitChange]) -> bool:
    return any(abs(peak.frequency - change.frequency) <= change.damping_ratio * change.frequency for change in changes)


def find_uncovered_peaks(
    frf: Frf | None, used: Sequence[Mode], machine: Machine, changes: Sequence[HitChange] = ()
) -> tuple[tuple[UnexplainedPeak, ...], list[Remark]]:
    """Find the measured peaks in [mode] band_hz that the modes used for lobes do not explain.

    A remark names each peak that they do not even explain within their errors. Peaks outside the band were left out on
    purpose: a remark names them, and no verdict depends on them. Without an FRF (no force) nothing is compared.
    changes: changes over the hits that have a remark of their own, which is the only one within their half-width.
    """
    peaks = () if frf is None else modal.find_unexplained_peaks(frf, used, machine.mode.band_hz)
    low, high = machine.mode.band_hz or (0.0, np.inf)
    inside = tuple(peak for peak in peaks if low <= peak.frequency <= high)
    outside = [f"{peak.frequency:.0f} Hz" for peak in peaks if peak not in inside]
    cure = PEAK_REMEDY_BESIDE_TIP if machine.tap.position_mm else PEAK_REMEDY
    remarks = [
        peak_remark(peak, cure) for peak in inside if not (peak.is_within_errors or _is_of_change(peak, changes))
    ]
    if outside:
        text = f"peak outside [mode] band_hz {low:g}..{high:g} Hz is not in the stability lobes"
        cure = "Widen [mode] band_hz if the peak belongs to the machine"
        remarks.append(Remark("peak-outside-band", ", ".join(outside), text, cure))
    return inside, remarks
