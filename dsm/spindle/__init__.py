"""Spindle as plain data: segments, materials, bearings, masses, joints."""

from dsm.spindle.attachments import Bearing, Damping, Joint, LumpedMass, Supports, damping_of_bearings, supports
from dsm.spindle.sections import CrossSection, Sections, sections
from dsm.spindle.segment import MATERIALS, SAME_PLACE, Material, Segment, nearest_index
from dsm.spindle.spindle import Spindle, Theory, change_tool, check_tool, cut_spindle, require_support

__all__ = [
    "MATERIALS",
    "SAME_PLACE",
    "Bearing",
    "CrossSection",
    "Damping",
    "Joint",
    "LumpedMass",
    "Material",
    "Sections",
    "Segment",
    "Spindle",
    "Supports",
    "Theory",
    "change_tool",
    "check_tool",
    "cut_spindle",
    "damping_of_bearings",
    "nearest_index",
    "require_support",
    "sections",
    "supports",
]
