"""Logbook of one machine, its analysis and the data of its charts."""

from .analysis import Analysis
from .chart_data import LobeComparison, ModelFigureData, collect_model_figure, compare_lobes
from .logbook import Logbook

__all__ = ["Analysis", "LobeComparison", "Logbook", "ModelFigureData", "collect_model_figure", "compare_lobes"]
