"""Verdicts on cutting programs: uncertainty, stability and limits, and settings that would be stable."""

from .program_case import SpindleAtSpeed
from .recommendation import Advice, advise, find_stable_pockets
from .setting_robustness import Setting
from .uncertainty import Uncertainty, uncertainty_of
from .verdict import Stability, StoredVerdict, Verdict

__all__ = [
    "Advice",
    "Setting",
    "SpindleAtSpeed",
    "Stability",
    "StoredVerdict",
    "Uncertainty",
    "Verdict",
    "advise",
    "find_stable_pockets",
    "uncertainty_of",
]
