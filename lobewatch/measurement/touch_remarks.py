"""Remark on hits with a further touch of the hammer."""

from collections.abc import Sequence

from acquisition import Hit, Remark
from acquisition.hit_quality.double_hit import find_highest_touch
from acquisition.hits.force_window import window_force


def touch_remarks(hits: Sequence[Hit]) -> list[Remark]:
    """Return the remark on averaged hits with a further touch of 2.5 % of the main peak or more; none without them."""
    parts = [window_force(hit) for hit in hits if hit.has_force]
    found = [(part, touch) for part in parts if (touch := find_highest_touch(part))]
    if not found:
        return []
    largest = max(touch.height / part.pulse.peak for part, touch in found)
    text = f"{len(found)} of {len(parts)} averaged hits touch twice, and the FRF includes both touches"
    return [Remark("touched-twice", "", f"{text} (second force peak up to {largest:.0%})")]
