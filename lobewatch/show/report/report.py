"""The report of one machine: one HTML file with everything in it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from lobewatch.logbook import Logbook
from lobewatch.logbook.analysis import Analysis
from lobewatch.show.history.describe_history import conditions_texts
from lobewatch.show.report.first_screen import first_screen
from lobewatch.show.report.material import ReportMaterial, report_material
from lobewatch.show.report.page import page, write_page
from lobewatch.show.report.sections import SECTIONS, MakesSections


def write_report(
    logbook: Logbook,
    path: Path | None = None,
    tool: str = "",
    direction: str = "",
    sections: Sequence[MakesSections] = SECTIONS,
) -> Path:
    """Write the report of one series, that of the newest test where none is named; DataError without a tap test.

    path None: report.html in the machine folder. sections: what makes those below its first screen, in their order.
    """
    newest = logbook.newest()
    html = render_report(logbook, tool or newest.tool, direction or newest.direction, sections=sections)
    path = path or logbook.folder.path / "report.html"
    write_page(path, html)
    return path


def render_report(
    logbook: Logbook,
    tool: str,
    direction: str,
    now: datetime | None = None,
    sections: Sequence[MakesSections] = SECTIONS,
) -> str:
    """HTML of one series (tool and direction); ValueError where it holds no tap test. now: None for the clock's."""
    return page("report.html", **logbook.ask(_content, tool, direction, now, sections))


def _content(
    analysis: Analysis, tool: str, direction: str, now: datetime | None, sections: Sequence[MakesSections]
) -> dict[str, Any]:
    """All that the template shows, from one analysis."""
    material = report_material(analysis, tool, direction, now)
    groups = [make(material) for make in sections]
    has_plots = any(section.has_plot for group in groups for section in group)
    return {"groups": groups, "has_plots": has_plots, "numbering": count(1), **_frame(material)}


def _frame(material: ReportMaterial) -> dict[str, Any]:
    """What stands above the sections and below them."""
    machine, last, tap = material.machine, material.last, material.newest
    return {
        "name": machine.machine.name,
        "tool": last.tool,
        "direction": last.direction,
        "first": material.rows[0].time,
        "last": last.time,
        "n_taps": len(material.rows),
        "as_of": material.outlook.standing.time.astimezone(),
        "label": machine.spindle.label if machine.spindle else "",
        "first_screen": first_screen(material),
        "tap_id": tap.id,
        "conditions": [*filter(None, [tap.circumstances.operator]), *conditions_texts(last.conditions)],
        "good": len(tap.accepted),
        "hits": len(tap.hits),
        "software": material.analysis.history.software,
    }
