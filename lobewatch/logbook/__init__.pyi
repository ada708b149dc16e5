"""One machine: the logbook and the questions that are answered from it."""

from .chart_data import LobeComparison, ModelFigureData, collect_model_figure, compare_lobes
from .logbook import Logbook

__all__ = [
    "LobeComparison",
    "Logbook",
    "ModelFigureData",
    "collect_model_figure",
    "compare_lobes",
]
