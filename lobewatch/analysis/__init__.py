"""From a tap test to what it means: measurement, history, prediction, verdict, standing."""

from lobewatch.analysis.advice import Advice, aging
from lobewatch.analysis.assembly import Assembly, lobes_of, speed_grid
from lobewatch.analysis.charts import Chart, Dynamics, Method, chart
from lobewatch.analysis.estimate import Estimate
from lobewatch.analysis.history import History, Row
from lobewatch.analysis.lobe_comparison import LobeComparison, compare_lobes
from lobewatch.analysis.logbook import Logbook, standing_of
from lobewatch.analysis.measurement import Measurement, measure
from lobewatch.analysis.model_picture import ModelPicture, model_picture
from lobewatch.analysis.model_state import ModelState, first_critical_speed, model_frf, model_state
from lobewatch.analysis.standing import Light, SeriesStanding, Standing, change_since_first
from lobewatch.analysis.verdict import Verdict, Word

__all__ = [
    "Advice",
    "Assembly",
    "Chart",
    "Dynamics",
    "Estimate",
    "History",
    "Light",
    "LobeComparison",
    "Logbook",
    "Measurement",
    "Method",
    "ModelPicture",
    "ModelState",
    "Row",
    "SeriesStanding",
    "Standing",
    "Verdict",
    "Word",
    "aging",
    "change_since_first",
    "chart",
    "compare_lobes",
    "first_critical_speed",
    "lobes_of",
    "measure",
    "model_frf",
    "model_picture",
    "model_state",
    "speed_grid",
    "standing_of",
]
