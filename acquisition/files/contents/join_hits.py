"""Join hits from several records or files into one tap test."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from acquisition.errors import Remark
from acquisition.hit import Hit
from acquisition.hits.capture_hits import MIN_LAST_HIT_SHARE

HIT_LEFT_OUT_CODE = "hit-left-out"
"""Code of the remark on a hit that a tap test is averaged without."""
_CURE = "Record and export each hit of a tap test once, with the same settings"
MAX_RATE_DIFFERENCE = 1e-4
"""Largest relative difference of equal sample rates: that of a rate with five digits."""


def make_left_out_remark(place: str, fault: str, cure: str = "") -> Remark:
    """Make the remark on a hit or a file that a tap test is averaged without."""
    return Remark(HIT_LEFT_OUT_CODE, place, f"not used: {fault.rstrip('.')}", cure)


def join_hits(hits: Mapping[str, Hit]) -> tuple[list[Hit], list[Remark]]:
    """Join hits, each with its place, and make a remark on each that is left out.

    Most hits of one sample rate with, or else without, a force count. Hits shorter than half the median are left out,
    the others are cut to the shortest. ADC codes are kept if all hits have the same channels.
    """
    usual = _choose_usual(hits)
    faults = {place: _find_difference(hit, usual) for place, hit in hits.items()}
    faults |= _find_repeated({place: hit for place, hit in hits.items() if not faults[place]})
    sizes = [hit.acceleration.size for place, hit in hits.items() if not faults[place]]
    least = MIN_LAST_HIT_SHARE * float(np.median(sizes))
    for place, hit in hits.items():
        if hit.acceleration.size < least and not faults[place]:
            faults[place] = f"{hit.acceleration.size} samples are less than half of the median ({np.median(sizes):g})"
    used = [hit for place, hit in hits.items() if not faults[place]]
    remarks = [make_left_out_remark(place, fault, _CURE) for place, fault in faults.items() if fault]
    n, channels = min(hit.acceleration.size for hit in used), {hit.channels for hit in used}
    before = used[0].pre_trigger if len({hit.pre_trigger for hit in used}) == 1 else 0
    alike = [replace(hit, sample_rate=usual.sample_rate, pre_trigger=before) for hit in used]
    return [_cut(hit, n, len(channels) == 1) for hit in alike], remarks


def _choose_usual(hits: Mapping[str, Hit]) -> Hit:
    """Return the first of most hits that can be joined, of equally many one with a force."""

    def rank(hit: Hit) -> tuple[int, bool]:
        return sum(not _find_difference(other, hit) for other in hits.values()), hit.has_force

    return max(hits.values(), key=rank)


def _find_difference(hit: Hit, usual: Hit) -> str:
    rate, usual_rate = hit.sample_rate, usual.sample_rate
    if abs(rate - usual_rate) > MAX_RATE_DIFFERENCE * min(rate, usual_rate):
        return f"sample rate {rate:.6g} Hz differs from the {usual_rate:.6g} Hz of the other hits"
    if hit.has_force != usual.has_force:
        return "no force, unlike the other hits" if usual.has_force else "a force, unlike the other hits"
    return ""


def _find_repeated(hits: Mapping[str, Hit]) -> dict[str, str]:
    """Return the hits that are copies of an earlier one, with this finding."""
    by_digest: dict[bytes, str] = {}
    digests = {place: hashlib.sha256(hit.signals.tobytes()).digest() for place, hit in hits.items()}
    originals = {place: by_digest.setdefault(digest, place) for place, digest in digests.items()}
    return {place: f"same samples as {first}" for place, first in originals.items() if place != first}


def _cut(hit: Hit, n: int, keeps_codes: bool) -> Hit:
    part = replace(hit, force=hit.force[:n], acceleration=hit.acceleration[:n], cross_hit=None)
    if keeps_codes and hit.codes is not None:
        return replace(part, codes=hit.codes[:, :n])
    return replace(part, codes=None, channels=hit.channels if keeps_codes else None)
