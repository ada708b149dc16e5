"""A measurement as a JSON object and as text."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from acquisition import Conditions, Remark
from dsm import PreloadLeft
from lobewatch.decay.series_history import preload_of, series_history
from lobewatch.logbook import Logbook
from lobewatch.machine import REFERENCE_CUT
from lobewatch.measuring import Measurement, remarks_on_all
from lobewatch.measuring.questions import QUESTIONS
from lobewatch.show.history.describe_history import conditions_texts
from lobewatch.show.programs.describe_lobes import lobes_json
from lobewatch.show.spindle.describe_model import calibration_json
from lobewatch.show.spindle.describe_modes import in_order, mode_json, mode_table, short_remark_lines
from lobewatch.show.terminal.output import remark_json, remark_lines
from lobewatch.tool import lobes_of


def measurement_json(m: Measurement, logbook: Logbook) -> dict[str, Any]:
    """A measurement, the diagrams of its tool as it was known then, and the programs as they stand now."""
    assembly = logbook.assembly(until=m.tap_id)
    return {
        "tap_id": m.tap_id,
        "time": m.time.isoformat(),
        "tool": m.tool,
        "direction": m.direction,
        "conditions": _conditions(m, logbook).known,
        "modes": [mode_json(mode) for mode in m.modes],
        "followed": mode_json(m.followed) if m.followed else None,
        "calibration": calibration_json(m.calibration) if m.calibration else None,
        "preload_left": _preload_left(m, logbook),
        "lobes": [lobes_json(name, lobes) for name, lobes in lobes_of(assembly, logbook.machine).items()],
        "remarks": [remark_json(remark) for remark in assembly.remarks],
    }


def measurement_texts(m: Measurement, logbook: Logbook) -> list[str | Table]:
    """A measurement for people."""
    named = [f"tool {m.tool}", f"direction {m.direction}", *conditions_texts(_conditions(m, logbook))]
    texts: list[str | Table] = [f"{m.tap_id}  ({', '.join(named)})"]
    if m.modes:
        shown = in_order(m.modes, rejected=False)
        texts += [mode_table(shown), *short_remark_lines(shown, remarks_on_all(m.modes))]
    if m.followed is not None:
        texts.append(f"followed: {m.followed.frequency:.2f} Hz")
    if m.calibration is not None:
        texts += [str(part) for part in (m.calibration, _preload_left(m, logbook)) if part is not None]
    assembly = logbook.assembly(until=m.tap_id)
    lobes = lobes_of(assembly, logbook.machine).get(REFERENCE_CUT)
    if lobes is not None:
        low = lobes.minimum
        texts.append(f"{REFERENCE_CUT}: lowest limit {low.depth * 1e3:.2f} mm at {low.speed_rpm:.0f} rpm")
    asked = [remark for remark in logbook.standing().remarks if remark.about == f"tap test {m.tap_id}"]
    further = [remark for remark in assembly.remarks if remark.code not in QUESTIONS]
    return [*texts, *remark_lines(further), *map(_asked, asked)]


def _preload_left(m: Measurement, logbook: Logbook) -> PreloadLeft | None:
    """Against the start of its series, as it was known then."""
    rows = [row for row in logbook.history.series(m.tool, m.direction) if row.time <= m.time]
    return preload_of(series_history(rows), logbook.machine) if rows and rows[-1].tap_id == m.tap_id else None


def _conditions(m: Measurement, logbook: Logbook) -> Conditions:
    return logbook.files.place(m.tap_id).entry.conditions


def _asked(question: Remark) -> str:
    """A question with its code."""
    return f"question ({question.code}): {question.text}"
