"""From a tap test to what it means: measurement, history, prediction, verdict."""

from .advice import ProgramAdvice, advise, unstable_programs
from .charts import DEEPEST, Chart, Dynamics, Method, chart
from .history import measure, partner, series, update_history
from .model_picture import ModelPicture
from .model_state import first_critical_speed, model_frf, model_picture, model_state
from .pipeline import Measurement, speed_grid
from .prediction import predict

__all__ = [
    "DEEPEST",
    "Chart",
    "Dynamics",
    "Measurement",
    "Method",
    "ModelPicture",
    "ProgramAdvice",
    "advise",
    "chart",
    "first_critical_speed",
    "measure",
    "model_frf",
    "model_picture",
    "model_state",
    "partner",
    "predict",
    "series",
    "speed_grid",
    "unstable_programs",
    "update_history",
]
