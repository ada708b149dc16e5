"""The spindle as plain data: segments, materials, bearings, masses, joints."""

from dsm.spindle.attachments import Bearing, Joint, LumpedMass
from dsm.spindle.change_tool import change_tool, check_tool
from dsm.spindle.cut_spindle import cut_spindle
from dsm.spindle.material import MATERIALS, Material
from dsm.spindle.places import SAME_PLACE, nearest
from dsm.spindle.sections import CrossSection, Sections, sections
from dsm.spindle.segment import Segment
from dsm.spindle.spindle import Spindle, Theory, require_support
from dsm.spindle.supports import Damping, Supports, given_damping, supports

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
    "given_damping",
    "nearest",
    "require_support",
    "sections",
    "supports",
]
