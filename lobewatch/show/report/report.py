"""The report of one machine: one HTML file with everything in it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import Frf, Remark, TapTest, joined
from dsm import plus_minus
from lobewatch.decay import SeriesStanding
from lobewatch.decay.series_history import SeriesHistory, preload_of
from lobewatch.history import Row
from lobewatch.logbook import Logbook
from lobewatch.logbook.outlook import Outlook, outlook
from lobewatch.machine import Machine
from lobewatch.show.figures.style import svg
from lobewatch.show.figures.trend_figures import frf_figure
from lobewatch.show.history.describe_history import conditions_texts
from lobewatch.show.programs.advice import ProgramAdvice, advice_lines, advise_program, decay_text
from lobewatch.show.programs.doubts import reading_lines
from lobewatch.show.programs.verdicts import WORDS, band_text, limit_text, margin_text, turning_text, verdict_text
from lobewatch.show.report.figure_data import response_numbers
from lobewatch.show.report.first_screen import first_screen
from lobewatch.show.report.lists import cut_lines, series_lines, tap_lines, tap_numbers
from lobewatch.show.report.lobe_course import lobe_course
from lobewatch.show.report.lobe_figures import lobe_figures, pocket_figures
from lobewatch.show.report.page import page, write_page
from lobewatch.show.report.trend_pictures import Picture, trends
from lobewatch.show.trends.describe_trend import ASSUMED, dates_rows, preload_text, sentence
from lobewatch.tool import ABOUT_DIRECTIONS, Assembly
from lobewatch.verdicts import Word

CHANGES = (
    ("frequency", "natural frequency (Hz)", 1.0),
    ("damping_ratio", "damping ratio (%)", 0.01),
    ("stiffness", "stiffness K (N/µm)", 1e6),
    ("bearing_stiffness", "bearing stiffness (N/µm)", 1e6),
)
"""Field of a row, what the table calls it, and the size of its unit."""


def write_report(logbook: Logbook, path: Path | None = None, tool: str = "", direction: str = "") -> Path:
    """Write the report of one series, that of the newest test where none is named; DataError without a tap test.

    path None: report.html in the machine folder.
    """
    newest = logbook.newest()
    html = render_report(logbook, tool or newest.tool, direction or newest.direction)
    path = path or logbook.folder.path / "report.html"
    write_page(path, html)
    return path


def render_report(logbook: Logbook, tool: str, direction: str, now: datetime | None = None) -> str:
    """HTML of one series (tool and direction); ValueError where it holds no tap test. now: None for the clock's."""
    return page("report.html", **_content_of(logbook, tool, direction, now))


def _content_of(logbook: Logbook, tool: str, direction: str, now: datetime | None) -> dict[str, Any]:
    rows = logbook.history.series(tool, direction)
    if not rows:
        raise ValueError(f"{logbook.folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    return _content(logbook, rows, outlook(logbook, now))


def _content(logbook: Logbook, rows: Sequence[Row], found: Outlook) -> dict[str, Any]:
    machine, last = logbook.machine, rows[-1]
    entries = {entry.id: entry for entry in logbook.taps}
    now = logbook.folder.read(entries[last.tap_id])
    assembly = logbook.assembly(last.tool)
    series = found.series(last.tool, last.direction)
    course = trends(logbook, rows, found.standing)
    programs = [advise_program(logbook, verdict) for verdict in logbook.verdicts()]
    cut = next(iter(machine.cuts(assembly.tool)), None)
    lobes = None if cut is None else lobe_course(cut, rows, assembly, found.standing.series, machine, logbook.cuts)
    return {
        "name": machine.machine.name,
        "tool": last.tool,
        "direction": last.direction,
        "first": rows[0].time,
        "last": last.time,
        "n_taps": len(rows),
        "software": logbook.history.software,
        "label": machine.spindle.label if machine.spindle else "",
        "first_screen": first_screen(found, programs, machine),
        "until": _until(found, series),
        "series": series_lines(found.standing),
        "taps": tap_lines(logbook),
        "cuts": cut_lines(logbook),
        "tap_numbers": tap_numbers(logbook),
        "changes": _changes(series.history),
        "preload": preload_text(left) if (left := preload_of(series.history, machine)) else "",
        **_programs(programs, machine),
        "remarks": [str(remark) for remark in _remarks(last, assembly)],
        **_newest(now, last),
        "figures": [
            *course.pictures,
            *lobe_figures(logbook, assembly, programs),
            *pocket_figures(lobes),
            _response(logbook.folder.read(entries[rows[0].tap_id]).frf if len(rows) > 1 else None, now.frf, machine),
        ],
        "course": lobes,
        "happened": course.happened,
        "limits": machine.limits,
    }


def _programs(programs: Sequence[ProgramAdvice], machine: Machine) -> dict[str, Any]:
    """The table of programs and what stands below it."""
    checked = [one.verdict for one in programs if one.verdict.word is not Word.UNKNOWN]
    return {
        "programs": [_program(one) for one in programs],
        "program_lines": [_whole(line) for one in programs for line in advice_lines(one, machine.speed)],
        "program_method": checked[0].method if checked else "",
        "program_doubt": [*map(_whole, reading_lines(checked, machine))],
    }


def _newest(tap: TapTest, row: Row) -> dict[str, Any]:
    """What is said of the newest test."""
    return {
        "modes": _modes(row),
        "said": [*filter(None, [tap.circumstances.operator]), *conditions_texts(row.conditions)],
        "tap_id": tap.id,
        "good": len(tap.accepted),
        "hits": len(tap.hits),
    }


def _until(found: Outlook, series: SeriesStanding) -> dict[str, Any] | None:
    """When programs stop holding; None where no test can be compared with."""
    if series.trend is None:
        return None
    return {"course": sentence(series), "dates": dates_rows(found), "assumed": ASSUMED}


def _remarks(last: Row, assembly: Assembly) -> list[Remark]:
    """Of the newest test of the series, and of x and y of its tool as they are known now."""
    own = [remark for remark in last.remarks if remark.code not in ABOUT_DIRECTIONS]
    return joined([*own, *(remark for remark in assembly.remarks if remark.code in ABOUT_DIRECTIONS)])


def _response(first: Frf | None, now: Frf, machine: Machine) -> Picture:
    shown = _shown_band(now, machine)
    text, picture = "Receptance: displacement over force.", svg(frf_figure(first, now, shown))
    return Picture("Frequency response", text, picture, response_numbers(now.in_band(shown)))


def _shown_band(frf: Frf, machine: Machine) -> tuple[float, float]:
    low, high = machine.mode.band_hz or frf.usable_band or (float(frf.frequency[0]), float(frf.frequency[-1]))
    return max(0.6 * low, float(frf.frequency[0])), min(1.4 * high, float(frf.frequency[-1]))


def _changes(series: SeriesHistory) -> list[dict[str, str]]:
    """What was measured first and last, and the change by the formula of the light."""
    table = []
    for name, label, scale in CHANGES:
        history = series.values[name]
        change = history.change
        if change.is_known:
            newest = getattr(history.known[-1], name)
            now, then = (plus_minus(estimate.value, estimate.std, scale) for estimate in (newest, history.start))
            table.append({"label": label, "then": then, "now": now, "change": f"{change.value:+.2f} %"})
    for name, label in (("static_tip_stiffness", "static"), ("modal_tip_stiffness", "modal")):
        values = [float(getattr(row, name)) for row in series.rows if np.isfinite(getattr(row, name))]
        if values and np.isfinite(getattr(series.rows[-1], name)):
            then, now = (f"{value / 1e6:.6g}" for value in (values[0], values[-1]))
            change_text = f"{100 * (values[-1] / values[0] - 1):+.2f} %"
            heading = f"{label} tip stiffness, model (N/µm)"
            table.append({"label": heading, "then": then, "now": now, "change": change_text})
    return table


def _modes(row: Row) -> list[dict[str, str]]:
    return [
        {
            "frequency": f"{frequency:.2f}",
            "damping": f"{damping * 100:.3f}",
            "stiffness": f"{stiffness / 1e6:.3f}",
            "remark": "" if stiffness > 0 else "not a driving point",
        }
        for frequency, damping, stiffness, _ in row.modes
    ]


def _program(one: ProgramAdvice) -> dict[str, Any]:
    """A row of the table of programs: what `lobewatch check` says."""
    found = one.verdict
    return {
        "name": found.program.name,
        "speed_rpm": found.program.speed_rpm,
        "depth_mm": found.program.depth_mm,
        "limit": limit_text(found),
        "band": band_text(found).replace("..", " to "),
        "margin": margin_text(found),
        "turning": turning_text(found),
        "left": decay_text(one.advice),
        "then": None if one.at_first is None else _looks(one.at_first.word, one.at_first.word.value),
        "now": _looks(found.word, verdict_text(found)),
    }


def _looks(word: Word, text: str) -> dict[str, str]:
    return {"kind": WORDS[word].kind, "text": f"{WORDS[word].symbol} {text}"}


def _whole(text: str) -> str:
    """No line ends within a number, or between it and its unit."""
    return re.sub(r"(?<=\d) (?=\d{3}\b|%|mm\b|rpm\b|Hz\b)", "\N{NO-BREAK SPACE}", text)
