"""Cutting programs judged over what is not known: doubt, draws, verdict, and settings that are safe."""

from .advice import Advice, advise
from .doubt import Doubt, doubt_of
from .robust_pockets import robust_pockets
from .setting_search import Setting
from .verdict import Ruling, Verdict, Word

__all__ = [
    "Advice",
    "Doubt",
    "Ruling",
    "Setting",
    "Verdict",
    "Word",
    "advise",
    "doubt_of",
    "robust_pockets",
]
