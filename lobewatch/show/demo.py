"""Show the tap tests of the demo: true and measured values."""

from collections.abc import Sequence
from pathlib import Path

from lobewatch.monitoring.threshold_dates import date_of_days
from lobewatch.show.terminal.output import JsonObject, Texts, new_table
from lobewatch.show.trend import reach_text
from lobewatch.tap.demo import DemoTap, LevelForecast, SpindleState

DEMO_COLUMNS = (("f1", "Hz", 1.0, 2), ("zeta", "%", 0.01, 3), ("K", "N/um", 1e6, 3), ("k_b", "N/um", 1e6, 1))
"""Symbol, unit, size of the unit and decimals of each value of a SpindleState."""


def demo_json(taps: Sequence[DemoTap], forecasts: Sequence[LevelForecast], report: Path) -> JsonObject:
    """Return all tap tests of the demo, and the forecast with the true dates."""
    levels = {item.level: {**item.reached.to_row(), "truth": _date_text(item.truth)} for item in forecasts}
    rows = [
        {
            "date": tap.plan.date.isoformat(),
            "direction": tap.plan.direction,
            "truth": _state_json(tap.plan.truth),
            "found": _state_json(tap.result),
        }
        for tap in taps
    ]
    return {"taps": rows, "forecast": levels, "report": str(report)}


def _state_json(state: SpindleState) -> JsonObject:
    keys = "frequency_hz", "damping_ratio", "stiffness_n_per_m", "bearing_stiffness_n_per_m"
    return dict(zip(keys, state, strict=True))


def _date_text(days: float | None) -> str | None:
    return None if days is None else f"{date_of_days(days):%Y-%m-%d}"


def demo_texts(taps: Sequence[DemoTap], forecasts: Sequence[LevelForecast], scatter: float, report: Path) -> Texts:
    """Return the true and the measured values, their errors, and the forecast with the true dates."""
    in_x = [tap for tap in taps if tap.plan.direction == "x"]
    first, last = in_x[0], in_x[-1]
    measured = last.result.relative_to(first.result).stiffness
    true = last.plan.truth.relative_to(first.plan.truth).stiffness
    symbols = [symbol for symbol, *_ in DEMO_COLUMNS]
    headings = [text for symbol, unit, *_ in DEMO_COLUMNS for text in (f"{symbol}\n({unit})", "tapped")]
    errors = zip(*(tap.result.relative_to(tap.plan.truth) for tap in taps), strict=True)
    worst = (f"{name} {100 * max(map(abs, values)):.2g} %" for name, values in zip(symbols, errors, strict=True))
    dates = (
        (item.level, reach_text(item.reached, taps[-1].plan.date), _date_text(item.truth) or "not for years")
        for item in forecasts
    )
    forecast: Texts = ["Forecast after the last test, compared with the emulated spindle:"]
    forecast.append(new_table("~event", "~forecast", "<true date", rows=dates))
    return [
        "True values of the emulated spindle, each next to the result of the tap test:",
        "natural frequency f1, damping ratio zeta, stiffness K at the tool tip,",
        "stiffness k_b of each bearing.",
        f"The tool is reclamped before each test, so that f1 scatters by {100 * scatter:g} %.",
        new_table("<test", *headings, rows=map(_demo_cells, taps)),
        f"largest error: {', '.join(worst)}",
        f"change of K over the demo, in x: {100 * measured:+z.2f} % tapped, {100 * true:+z.2f} % true",
        *(forecast if forecasts else []),
        f"report: {report}",
    ]


def _demo_cells(tap: DemoTap) -> list[str]:
    pairs = zip(tap.plan.truth, tap.result, DEMO_COLUMNS, strict=True)
    values = (f"{value / scale:.{digits}f}" for *pair, (*_, scale, digits) in pairs for value in pair)
    return [f"{tap.plan.date:%Y-%m} {tap.plan.direction}", *values]
