"""Reasons why the modes of a tap test do not cover its measurement."""

from collections.abc import Iterable
from dataclasses import replace

from acquisition import Remark
from lobewatch.measurement.hit_remarks import HIT_CHANGE_CODES

PEAK_CODE = "peak-not-explained"
"""Code of the remark on a measured peak that the accepted modes do not explain."""
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
