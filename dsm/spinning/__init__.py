"""Spinning beams that need not be round."""

from dsm.spinning.beam import SpinningBeam, SpinningSegment, SpinningSpring
from dsm.spinning.element import spinning_element
from dsm.spinning.frequencies import UnstableSpinError, spinning_frequencies

__all__ = [
    "SpinningBeam",
    "SpinningSegment",
    "SpinningSpring",
    "UnstableSpinError",
    "spinning_element",
    "spinning_frequencies",
]
