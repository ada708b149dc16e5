"""Make the report section of the values measured besides the frequency, and of their changes."""

from collections.abc import Iterator

import numpy as np

from dsm import format_rounded
from lobewatch.machine import Machine
from lobewatch.monitoring.drop_text import format_change
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS
from lobewatch.monitoring.series_history import SeriesHistory, compare_bearings, estimate_preload
from lobewatch.show.report.report_data import ReportData
from lobewatch.show.report.section import DataTable, Paragraph, Section
from lobewatch.show.terminal.sentences import capitalize
from lobewatch.show.trend import INTERVAL_NOTE

CHANGE_VALUES = (
    ("damping_ratio", "damping ratio zeta (%)", 0.01),
    ("stiffness", "stiffness K (N/µm)", 1e6),
)
"""Field of a row, its name in the table, and the size of its unit."""
MODEL_CHANGE_VALUES = (("static_tip_stiffness", "static"), ("modal_tip_stiffness", "modal"))
"""Field of a row from the model, and its name in the table."""


def make_values(data: ReportData) -> list[Section]:
    """Make the table of the other values: at the start, newest, and their change; only values for a single test."""
    history = data.series.history
    rows = [*_measured_changes(history), *_bearing_changes(history, data.machine), *_model_changes(history)]
    if not rows:
        return []
    heads = ["value", f"start ({data.rows[0].time:%Y-%m-%d})", f"newest ({data.last.time:%Y-%m-%d})", "change"]
    text = f"{INTERVAL_NOTE}. zeta and K have one from {MIN_FORECAST_POINTS} points on."
    if data.series.is_baseline:
        heads, rows, text = ["value", heads[2]], [[name, now] for name, _, now, _ in rows], ""
    preload = estimate_preload(history, data.machine)
    left = "" if preload is None else f"{capitalize(str(preload))}."
    parts = DataTable(heads, rows), Paragraph(text, is_small=True), Paragraph(left)
    return [Section("Measured values", parts, "folded")]


def _measured_changes(history: SeriesHistory) -> Iterator[list[str]]:
    for name, label, scale in CHANGE_VALUES:
        values = history.values[name]
        drop = values.drop_at(history.rows[-1])
        if drop.is_known:
            newest = getattr(history.rows[-1], name)
            start, now = (format_rounded(it.value, it.std, scale) for it in (values.start, newest))
            yield [label, start, now, format_change(drop.value, drop.half_width)]


def _bearing_changes(history: SeriesHistory, machine: Machine) -> Iterator[list[str]]:
    """Yield the bearing stiffness by the drop of the frequency, or as calibrated to a single test."""
    label, measured = "bearing stiffness k_b (N/µm)", history.rows[-1].bearing_stiffness
    change = compare_bearings(history, machine)
    if change is not None:
        start, now = (format_rounded(value, value * change.half_width / 100, 1e6) for value in change[:2])
        yield [label, start, now, format_change(-change.percent, change.half_width)]
    elif measured.is_known:
        yield [label, "-", format_rounded(measured.value, measured.std, 1e6), "-"]


def _model_changes(history: SeriesHistory) -> Iterator[list[str]]:
    for name, label in MODEL_CHANGE_VALUES:
        values = [float(getattr(row, name)) for row in history.rows if np.isfinite(getattr(row, name))]
        if values and np.isfinite(getattr(history.rows[-1], name)):
            start, now = (f"{value / 1e6:.6g}" for value in (values[0], values[-1]))
            yield [f"{label} tip stiffness, model (N/µm)", start, now, f"{100 * (values[-1] / values[0] - 1):+z.2f} %"]
