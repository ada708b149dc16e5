"""x"""
from __future__ import annotations
from modal.extract import Extraction
from modal.mode import Mode
def assess(state: Extraction, modes: list[Mode]) -> list[Mode]:
    return modes
