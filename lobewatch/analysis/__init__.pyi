"""From a tap test to what it means: measurement, history, prediction, verdict, standing."""

from .assembly import ABOUT_DIRECTIONS, Assembly, lobes_of, speed_grid
from .charts import Chart, Dynamics, Method, chart
from .decay.fallen import change_since_start
from .estimate import Estimate
from .file_modes import FileModes, modes_of_file, remarks_on_all
from .history import History, Row
from .lobe_comparison import LobeComparison, compare_lobes
from .logbook import Logbook
from .measurement import Measurement, measure
from .model_calibration import ModelCalibration, calibrate_model
from .model_picture import ModelPicture, model_picture
from .model_state import ModelState, first_critical_speed, model_frf, model_state
from .model_summary import ModelMode, ModelSummary, model_summary
from .one_file.recorded_window import Window
from .plant.light import Light
from .programs import Advice, Setting, Verdict, Word
from .standing import SeriesStanding, Standing, unreadable

__all__ = [
    "ABOUT_DIRECTIONS",
    "Advice",
    "Assembly",
    "Chart",
    "Dynamics",
    "Estimate",
    "FileModes",
    "History",
    "Light",
    "LobeComparison",
    "Logbook",
    "Measurement",
    "Method",
    "ModelCalibration",
    "ModelMode",
    "ModelPicture",
    "ModelState",
    "ModelSummary",
    "Row",
    "SeriesStanding",
    "Setting",
    "Standing",
    "Verdict",
    "Window",
    "Word",
    "calibrate_model",
    "change_since_start",
    "chart",
    "compare_lobes",
    "first_critical_speed",
    "lobes_of",
    "measure",
    "model_frf",
    "model_picture",
    "model_state",
    "model_summary",
    "modes_of_file",
    "remarks_on_all",
    "speed_grid",
    "unreadable",
]
