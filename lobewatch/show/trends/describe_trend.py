"""The trend of one series and what becomes of the machine: for people, as CSV, as JSON."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

from rich.table import Table

from dsm import PreloadLeft, plus_minus
from lobewatch.decay import SeriesStanding
from lobewatch.decay.shapes import Shape
from lobewatch.decay.trend import Trend, date
from lobewatch.logbook.outlook import Fate, Outlook
from lobewatch.show.terminal.output import table
from lobewatch.show.trends.chart import chart_lines
from lobewatch.show.trends.dates import ASSUMED, dates_json, dates_text


def trend_json(outlook: Outlook, series: SeriesStanding, preload: PreloadLeft | None) -> dict[str, Any]:
    """Points, score, alarm, light, preload, forecast; percents are 100 ln of the frequency over that of the first."""
    trend = series.trend
    return {
        "tool": series.tool,
        "direction": series.direction,
        "points": [] if trend is None else _points_json(trend),
        "score": None if trend is None or not trend.watch.scores.size else float(trend.watch.scores[-1]),
        "alarm": None if trend is None else _alarm_json(trend),
        "light": outlook.standing.light.value,
        "fall_percent": series.fall.value,
        "fall_std_percent": series.fall.std,
        "preload_left": preload,
        "rate_percent_per_month": None if trend is None or trend.rate is None else trend.rate._asdict(),
        "forecast": {
            **{name: _fate_json(fate) for name, fate in outlook.programs.items()},
            **{f"{percent:g} %": {"reached": dates_json(when)} for percent, when in outlook.limits.items()},
        },
    }


def trend_csv(series: SeriesStanding) -> str:
    """A line a point, headings on top."""
    written = io.StringIO()
    heads = ["time", "percent", "error_percent", "temperature_c", "taps", "score"]
    writer = csv.writer(written, lineterminator="\n")
    writer.writerow(heads)
    trend = series.trend
    if trend is not None:
        for point, score in zip(trend.points, _scores(trend), strict=True):
            numbers = (point.percent, point.error, point.temperature)
            row = [point.time.isoformat(), *map(_cell, numbers), len(point.taps), _cell(score)]
            writer.writerow(row)
    return written.getvalue()


def trend_texts(outlook: Outlook, series: SeriesStanding, preload: PreloadLeft | None) -> list[str | Table]:
    """Chart, sentence and table."""
    trend = series.trend
    if trend is None:
        return [f"{series.name}: no tap test that others can be compared with"]
    dates = table("~what", "~becomes doubtful", "~is not stable")
    for line in dates_rows(outlook):
        dates.add_row(*line)
    further = [f"{side.name}: {short_text(side)}" for side in outlook.standing.series if side is not series]
    left = [] if preload is None else [preload_text(preload)]
    return [*chart_lines(trend), sentence(series), *left, dates, ASSUMED, *further]


def preload_text(preload: PreloadLeft) -> str:
    """What is left of the preload."""
    return f"preload left: {preload}"


def dates_rows(outlook: Outlook) -> list[tuple[str, str, str]]:
    """What, when it becomes doubtful, when it is not stable: each program, and the fixed limits."""
    end = outlook.horizon
    rows = [(name, *_fate_texts(fate, end)) for name, fate in outlook.programs.items()]
    for percent, when in outlook.limits.items():
        rows.append((f"-{percent:g} % (fixed limit, as in the paper)", "", dates_text(when, end)))
    return rows


def _fate_texts(fate: Fate, end: float) -> tuple[str, str]:
    tapped = fate.critical.doubtful == 0, fate.critical.not_stable == 0
    return dates_text(fate.doubtful, end, tapped=tapped[0]), dates_text(fate.not_stable, end, tapped=tapped[1])


def sentence(series: SeriesStanding) -> str:
    """What the series has done so far."""
    trend = series.trend
    if trend is None:
        return f"{series.name}: unknown"
    n = len(trend.points)
    text = f"{series.name}: {short_text(series)} after {n} point{'s' if n > 1 else ''}"
    if trend.forecast is None:
        return f"{text}; from 8 points on there is a forecast, from 9 on an alarm"
    shape = _shape(trend.forecast.likeliest, falls=trend.forecast.fitted[-1] < trend.start)
    return f"{text}; {shape}; scatter {trend.spread:.2f} %, score {_score(trend)}; {rate_text(trend)}"


def rate_text(trend: Trend) -> str:
    """Change in % a month at the last point, with its 95 % interval; empty below 8 points."""
    rate = trend.rate
    if rate is None:
        return ""
    digits = max(2, -math.floor(math.log10(max(rate.high - rate.low, 1e-4))))
    value, low, high = (f"{percent:+.{digits}f}" for percent in rate)
    return f"{value} % a month now ({low} to {high}, 95 %)"


def short_text(series: SeriesStanding) -> str:
    """How far it has fallen, with its standard error."""
    fall = series.fall
    return f"{plus_minus(-fall.value, fall.std)} % since it started" if fall.is_known else "unknown"


def _shape(shape: Shape, falls: bool) -> str:
    since, goes, went = f"{date(shape.start):%Y-%m-%d}", *(("falling", "fell") if falls else ("rising", "rose"))
    steadily = f"{goes} steadily since {since}"
    words = {"none": "steady", "line": steadily, "slope": steadily, "step": f"{went} once before {since}, steady since"}
    return words.get(shape.kind, f"{goes}, {'faster and faster' if shape.accelerates else 'ever more slowly'}")


def _score(trend: Trend) -> str:
    score = _scores(trend)[-1]
    return f"{score:.1f} (alarm at 3.3 twice)" if math.isfinite(score) else "from 9 points on"


def _scores(trend: Trend) -> list[float]:
    """One a point; NaN where none is judged."""
    return [*[math.nan] * trend.watched, *map(float, trend.watch.scores)]


def _points_json(trend: Trend) -> list[dict[str, Any]]:
    return [{"time": point.time.isoformat(), "percent": point.percent, "used": True} for point in trend.points]


def _alarm_json(trend: Trend) -> dict[str, Any] | None:
    fall, since = trend.watch.fall, trend.fallen_since
    if fall is None or since is None:
        return None
    return {"kind": fall.kind, "since": since.isoformat(), "size_percent": fall.size}


def _fate_json(fate: Fate) -> dict[str, Any]:
    return {"doubtful": dates_json(fate.doubtful), "not stable": dates_json(fate.not_stable)}


def _cell(value: float) -> float | str:
    return value if math.isfinite(value) else ""
