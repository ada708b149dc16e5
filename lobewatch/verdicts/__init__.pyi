"""What a tool allows: doubt, word and limit of each program, why, and settings that would be safe."""

from .advice import Advice, advise, robust_pockets
from .doubt import Doubt, doubt_of
from .setting import Setting
from .spindle_at_speed import SpindleAtSpeed
from .verdict import Ruling, Verdict, Word

__all__ = [
    "Advice",
    "Doubt",
    "Ruling",
    "Setting",
    "SpindleAtSpeed",
    "Verdict",
    "Word",
    "advise",
    "doubt_of",
    "robust_pockets",
]
