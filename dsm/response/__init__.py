"""Receptance and static stiffness, and tools coupled to them."""

from dsm.response.couple_tool import couple_tool
from dsm.response.linearized_stiffness import linearized_stiffness
from dsm.response.receptance import receptance
from dsm.response.spindle_side import SpindleSide, spindle_side
from dsm.response.static_stiffness import static_stiffness

__all__ = [
    "SpindleSide",
    "couple_tool",
    "linearized_stiffness",
    "receptance",
    "spindle_side",
    "static_stiffness",
]
