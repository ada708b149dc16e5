"""A spindle without its tool."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from dsm.spindle.attachments import Bearing, Joint, LumpedMass
from dsm.spindle.places import SAME_PLACE, nearest
from dsm.spindle.segment import Segment
from dsm.spindle.spindle import Spindle

Part = TypeVar("Part", Bearing, LumpedMass, Joint)


def cut_spindle(spindle: Spindle, position: float) -> tuple[Spindle, Joint | None]:
    """What lies beyond `position` from the tool tip (m), its own positions counted from the cut; the joint at the cut.

    A segment there is cut in two. Bearings, masses and joints nearer to the tool tip fall away; a bearing or a mass at
    the cut stays. Raises ValueError for a cut off the shaft or at its far end.
    """
    slack = SAME_PLACE * spindle.length
    if not 0 <= position < spindle.length - slack:
        raise ValueError(f"position={position} m leaves no spindle; cut it between 0 and {spindle.length:g} m")
    ends = np.cumsum([0.0, *(segment.length for segment in spindle.segments)])
    end = float(ends[nearest(ends, position)])
    cut = end if abs(end - position) <= slack else float(position)
    at_cut = [joint for joint in spindle.joints if abs(joint.position - cut) <= slack]
    rest = replace(
        spindle,
        segments=[
            _tail(segment, max(cut - start, 0.0))
            for segment, start, end in zip(spindle.segments, ends[:-1], ends[1:], strict=True)
            if end > cut
        ],
        bearings=moved([part for part in spindle.bearings if part.position >= cut - slack], -cut),
        masses=moved([part for part in spindle.masses if part.position >= cut - slack], -cut),
        joints=moved([part for part in spindle.joints if part.position > cut + slack], -cut),
    )
    return rest, at_cut[0] if at_cut else None


def moved(parts: Iterable[Part], shift: float) -> list[Part]:
    """The same parts, further from the tool tip by `shift` (m); none before it."""
    return [replace(part, position=max(part.position + shift, 0.0)) for part in parts]


def _tail(segment: Segment, removed: float) -> Segment:
    """What is left of a segment without its first part, of length `removed` (m)."""
    outer, bore = segment.diameters_at(removed / segment.length)
    return replace(segment, length=segment.length - removed, outer_diameter=outer, bore_diameter=bore)
