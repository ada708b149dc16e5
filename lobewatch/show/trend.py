"""Show the trend of a series: chart, sentences, forecast dates, CSV and JSON."""

import math
from datetime import datetime
from typing import Any

import numpy as np

from acquisition import Remark
from acquisition.errors import join_sentences
from dsm import RemainingPreload
from lobewatch.arrays import Floats, Indices
from lobewatch.logbook.machine_forecast import MachineForecast
from lobewatch.monitoring import SeriesStatus
from lobewatch.monitoring.change_detection import MIN_MONITORED_POINTS, SURE_CHANGE_SCORE
from lobewatch.monitoring.drop_text import describe_drop, format_change
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS
from lobewatch.monitoring.threshold_dates import ThresholdDates, build_forecast_rows, date_of_days
from lobewatch.monitoring.trend import Trend, days_since_epoch, point_days
from lobewatch.monitoring.trend_shapes import TrendShape
from lobewatch.show.terminal.output import JsonObject, Texts, blank_nonfinite, count_noun, format_csv, new_table
from lobewatch.show.terminal.sentences import capitalize, wrap_lines
from lobewatch.show.terminal.status_labels import status_label

FORECAST_ASSUMPTIONS = (
    "Dates assume unchanged use of the machine, without crashes or new faults. "
    "On public records of 33 simulated engines and one measured bearing, 18 % of the dates came before the "
    "80 % range and 1 % after it. "
    "These records also served to choose the settings."
)
"""Note below every table of forecast dates."""
TREND_CODES = ("frequency-alarm", "frequency-warn", "decay", "program-not-stable", "program-doubtful")
"""Codes of remarks that the trend of a machine with forecast dates contains."""
INTERVAL_NOTE = "± is the 95 % interval, which contains reclamping"
"""Note on the interval of a drop."""
CHART_WIDTH, CHART_HEIGHT = 60, 12
"""Size of the plot area (characters)."""


def trend_json(outlook: MachineForecast, series: SeriesStatus, preload: RemainingPreload | None) -> JsonObject:
    """Return points, score, alarm, status and forecast; percents are 100 ln of the frequency over that of the first."""
    status, trend = outlook.status, series.trend
    points, rate = trend.points if trend else (), trend and trend.rate
    used = [{"time": point.time.isoformat(), "percent": point.percent, "used": True} for point in points]
    return {
        "tool": series.tool,
        "direction": series.direction,
        "points": used,
        "score": trend and trend.detection.scores[-1],
        "alarm": trend and _drop_json(trend),
        "alarms": [alarm.to_row(status.time) for alarm in status.alarms],
        "light": status.status,
        "fall_percent": series.drop.value,
        "fall_std_percent": series.drop.std,
        "fall_interval_percent": series.drop.interval,
        "is_change_proven": series.is_change_proven,
        "scatter": trend and _scatter_json(trend),
        "preload_left": preload,
        "rate_percent_per_month": rate and rate._asdict(),
        "forecast": build_forecast_rows(outlook.programs, outlook.limits),
    }


def _drop_json(trend: Trend) -> JsonObject | None:
    drop, since = trend.open_drop, trend.drop_since
    if drop is None:
        return None
    change = drop.change
    interval = change.size - change.half_width, change.size + change.half_width
    row = {"kind": change.kind, "since": since and since.isoformat(), "size_percent": change.size}
    return row | {"size_interval_percent": interval}


def _scatter_json(trend: Trend) -> JsonObject:
    """Return the scatter of a point (%), and whether it is independent from point to point."""
    check = trend.scatter_check
    checked = check and {**check._asdict(), "is_independent": check.is_independent}
    shares = check and {"false_alarm_share_in_24_points": check.false_alarm_share}
    return {"percent": trend.drop_model.scatter.percent, **(checked or {}), **(shares or {})}


def trend_csv(series: SeriesStatus) -> str:
    """Return a CSV line for each point, below the headings."""
    rows: list[list[Any]] = [["time", "percent", "error_percent", "temperature_c", "taps", "score"]]
    if series.trend is not None:
        for point, score in zip(series.trend.points, series.trend.detection.scores.tolist(), strict=True):
            numbers = (point.percent, point.error, point.temperature, len(point.taps), score)
            rows.append([point.time.isoformat(), *map(blank_nonfinite, numbers)])
    return format_csv(rows)


def trend_texts(outlook: MachineForecast, series: SeriesStatus, preload: RemainingPreload | None) -> Texts:
    """Return chart, facts and forecast dates of a series, the change of the other series, and the next step."""
    if series.trend is None:
        return [f"{series.name}: no tap test yet to compare later tests with"]
    facts = [*_trend_facts(series), *([] if preload is None else [str(preload)])]
    texts: Texts = [*chart_lines(series.trend), f"{series.name}:", *wrap_lines(facts)]
    texts += [
        f"{other.name}: {change_since_start_text(other)}" for other in outlook.status.series if other is not series
    ]
    dates = new_table("~program or limit", "~doubtful", "~not stable", rows=forecast_date_rows(outlook))
    why_none = no_dates_text(outlook)
    texts += [why_none] if why_none else [dates, *wrap_lines([FORECAST_ASSUMPTIONS], "")]
    status = outlook.status
    return [*texts, *wrap_lines([f"{status_label(status.status, status.is_early)}  Next: {status.next_step}"], "")]


def trend_remarks(outlook: MachineForecast) -> list[Remark]:
    """Return the remarks on a machine that its trend in words does not contain."""
    status = outlook.status
    acknowledged = {(alarm.code, alarm.about) for alarm in status.alarms if alarm.is_acknowledged(status.time)}
    shown = () if no_dates_text(outlook) else TREND_CODES
    return [
        remark for remark in status.remarks if remark.code not in shown or (remark.code, remark.about) in acknowledged
    ]


def forecast_date_rows(outlook: MachineForecast) -> list[tuple[str, str, str]]:
    """Return when each program becomes doubtful and not stable, and when the fixed limits are reached."""
    now, rows, unknown = outlook.status.time, list[tuple[str, str, str]](), open_questions_text(outlook)
    for name, fate in outlook.programs.items():
        dates = [reach_text(reach, now, unknown) for reach in (fate.doubtful, fate.not_stable)]
        rows.append((name, *(("unknown, see lobewatch check",) * 2 if name in outlook.unknown_programs else dates)))
    limits = [(f"-{percent:g} % (fixed limit)", reach_text(reach, now, unknown)) for percent, reach in outlook.limits]
    return rows + [(name, "", text) for name, text in limits]


def open_questions_text(outlook: MachineForecast) -> str:
    """Return the number of tests with open questions in the series without a forecast; empty without any."""
    trends = [(series.history.frequency, series.trend) for series in outlook.status.series]
    asked = sum(int(one.has_questions.sum()) for one, trend in trends if trend is None or trend.forecast is None)
    noun, verb = count_noun(asked, "test"), "does" if asked == 1 else "do"
    return f"unknown, {noun} with open questions {verb} not count" if asked else ""


def no_dates_text(outlook: MachineForecast) -> str:
    """Return the reason for no forecast; empty if there is one, or if all limits are reached already."""
    reaches = [reach for fate in outlook.programs.values() for reach in (fate.doubtful, fate.not_stable)]
    reaches += [reach for _, reach in outlook.limits]
    if any(reach.forecast_end is not None for reach in reaches) or all(reach.is_measured for reach in reaches):
        return ""
    trends = [series.trend for series in outlook.status.series if series.trend]
    if any(trend.is_stale for trend in trends):
        return "No forecast: the last tap tests are too old. Tap again."
    points = max((min(len(trend.points), MIN_FORECAST_POINTS - 1) for trend in trends), default=0)
    return f"No forecast yet: a forecast needs {MIN_FORECAST_POINTS} points, and the longest series has {points}."


def trend_sentence(series: SeriesStatus) -> str:
    """Return the trend of the series in sentences, without the last full stop."""
    first, *others = _trend_facts(series)
    return f"{series.name}: {join_sentences(first, *map(capitalize, others))}".removesuffix(".")


def _trend_facts(series: SeriesStatus) -> list[str]:
    """Return change, trend and scatter of a series."""
    trend = series.trend
    if trend is None:
        return ["unknown"]
    n, change = len(trend.points), change_since_start_text(series)
    interval = [f"{INTERVAL_NOTE} ({n} points)"] if n > 1 else []
    if trend.forecast is None:
        known = trend.readings.scatter_prior.single
        least = f"5 points (scatter of other series: {known.percent:.2f} %)" if known.freedom else "9 points"
        return [change, *interval, f"trend alarms need {least}, but the fixed limits always apply"]
    score = f"from {MIN_MONITORED_POINTS} points on"
    if not math.isnan(trend.detection.scores[-1]):
        score = f"{max(trend.detection.scores[-1], 0.0):.1f} (alarm: {SURE_CHANGE_SCORE:g} or more in two clampings)"
    kind = trend_text(series) if series.is_change_proven else ""
    now = ", ".join(filter(None, (kind, rate_text(trend))))
    return [change, *interval, now, f"scatter of f1 {trend.spread:.2f} %, change score {score}"]


def rate_text(trend: Trend) -> str:
    """Return the change in % a month at the last point, with its 95 % interval; empty below 8 points."""
    rate = trend.rate
    if rate is None:
        return ""
    digits = max(2, -math.floor(math.log10(max(rate.high - rate.low, 1e-4))))
    inside = min(max(rate.value, rate.low), rate.high)
    value, low, high = (f"{round(percent, digits) + 0.0:+.{digits}f}" for percent in (inside, rate.low, rate.high))
    return f"{value} % a month now (95 % interval {low} to {high})"


def change_since_start_text(series: SeriesStatus) -> str:
    """Return the frequency change since the series started, as a finding."""
    return describe_drop(series.drop.value, series.drop.half_width, is_proven=series.is_change_proven)


def change_text(series: SeriesStatus) -> str:
    """Return the frequency change since the series started, with its 95 % interval."""
    drop = series.drop
    return format_change(drop.value, drop.half_width) if drop.is_known else "unknown"


def trend_text(series: SeriesStatus) -> str:
    """Return kind and date of a change that is proven; empty below 8 points."""
    trend = series.trend
    if trend is None or trend.likeliest_shape is None or trend.forecast is None:
        return ""
    if not series.is_change_proven:
        return "no change proven"
    if trend.open_drop is not None:
        return _alarm_text(trend)
    if not trend.has_certain_shape:
        return "date of the change unknown"
    return _shape_text(trend.likeliest_shape, falls=trend.forecast.fitted[-1] < trend.start)


def _alarm_text(trend: Trend) -> str:
    """Return kind and date of the drop of an alarm."""
    fallen, since = trend.open_drop, trend.drop_since
    if fallen is None or since is None:
        return ""
    words = {"step": "dropped at once before", "slope": "dropping since", "mixed": "dropped at once and steadily since"}
    text = f"{words.get(fallen.change.kind, 'dropped since')} {since:%Y-%m-%d}"
    return f"{text}, slower now (may be run-in)" if trend.is_run_in else text


def _shape_text(shape: TrendShape, falls: bool) -> str:
    since, goes, went = (
        f"{date_of_days(shape.start):%Y-%m-%d}",
        *(("dropping", "dropped") if falls else ("rising", "rose")),
    )
    steadily = f"{goes} steadily since {since}"
    words = {
        "none": "steady",
        "line": steadily,
        "slope": steadily,
        "step": f"{went} once before {since}, steady since",
        "slopes": f"{goes} at another rate since {since}",
        "breaks": f"{goes} at another rate since {since}",
        "crash": f"{went} at once before {since}, also {goes} steadily",
        "wander": f"{goes} irregularly",
        "bend": f"{goes} at a changing rate",
        "late wander": f"{goes} irregularly since {since}",
        "late bend": f"{goes} at a changing rate since {since}",
        "late curve": f"{goes} faster and faster since {since}",
        "late runaway": f"{goes} faster and faster since {since}",
    }
    return words.get(shape.kind, f"{goes} {'faster and faster' if shape.accelerates else 'more and more slowly'}")


def reach_text(reach: ThresholdDates, now: datetime, unknown: str = "") -> str:
    """Return when a limit is reached in words; unknown: reason for no date other than a short or old history."""
    if reach.is_measured:
        return "already"
    if reach.forecast_end is None:
        return unknown or "history too short or too old"
    if reach.earliest is None:
        return f"not before {date_of_days(reach.forecast_end):%Y-%m}"
    today = days_since_epoch(now)
    if reach.latest is None:
        return f"not before {_day_or_now(reach.earliest, today)}"
    if reach.latest <= today:
        return f"by now at this rate (probably {date_of_days(reach.probable or today):%Y-%m-%d})"
    days = reach.earliest, reach.probable or today, reach.latest
    earliest, probable, latest = (_day_or_now(day, today) for day in days)
    return f"between {earliest} and {latest} (80 %), probably {probable}"


def _day_or_now(days: float, today: float) -> str:
    return f"{date_of_days(days):%Y-%m-%d}" if days > today else "now"


def chart_lines(trend: Trend) -> list[str]:
    """Return a chart of characters: points and fitted line (%) over the dates, a drop downwards."""
    dates, rows = point_days(trend.points), CHART_HEIGHT
    percent = -trend.drops
    low, high = float(percent.min()), float(percent.max())
    low, high = (low, high) if high > low else (low - 0.5, high + 0.5)
    canvas = np.full((rows, CHART_WIDTH), " ")
    if trend.forecast is not None:
        fitted = 100 * np.expm1((trend.forecast.fitted - trend.start) / 100)
        line = np.interp(np.linspace(dates[0], dates[-1], CHART_WIDTH), dates, fitted)
        canvas[_canvas_indices(np.clip(line, low, high), high, low, rows), np.arange(CHART_WIDTH)] = "."
    columns = _canvas_indices(dates, dates[0], dates[-1], CHART_WIDTH)
    canvas[_canvas_indices(percent, high, low, rows), columns] = "o"
    ticks = [f"{value:+8.2f} %" for value in np.linspace(high, low, rows).tolist()]
    labels = [tick if row % 4 == 0 or row == rows - 1 else " " * 10 for row, tick in enumerate(ticks)]
    drawn = [f"{label} |{''.join(cells)}".rstrip() for label, cells in zip(labels, canvas, strict=True)]
    first, last = (f"{date_of_days(days):%Y-%m-%d}" for days in dates[[0, -1]])
    return [*drawn, " " * 11 + "+" + "-" * CHART_WIDTH, " " * 12 + first + last.rjust(CHART_WIDTH - len(first))]


def _canvas_indices(values: Floats, start: float, end: float, count: int) -> Indices:
    span = end - start
    share = (values - start) / span if span else np.zeros(values.size)
    return np.round(share * (count - 1)).astype(np.intp)
