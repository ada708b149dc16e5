"""One machine: the logbook and the questions that are answered from it."""

from .lobe_comparison import LobeComparison, compare_lobes
from .logbook import Logbook
from .model_picture import ModelPicture, model_picture

__all__ = [
    "LobeComparison",
    "Logbook",
    "ModelPicture",
    "compare_lobes",
    "model_picture",
]
