"""The speed and depth that are recommended for a cut that somebody asks about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from acquisition import DataError
from lobewatch.cuts.learning.at_speed import spindle_at_speed
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.settings.asked_cut import present_speed, wanted_cut
from lobewatch.verdicts.recommendation import Recommendation, recommend
from lobewatch.verdicts.spindle_at_speed import AT_REST


def recommended(logbook: Logbook, said: Mapping[str, Any]) -> Recommendation:
    """Of the cut that is said (see `wanted_cut`), on all that tap tests and test cuts say of its tool.

    said: its depth_mm is asked for, its speed_rpm is that of now. ValueError for a cut that is none, DataError where
    there is no tap test.
    """
    machine = logbook.machine
    table, either = wanted_cut(machine, said)
    logbook.newest()
    tool = logbook.ask(Analysis.assembly_or_reason, table.tool)
    at_speed = AT_REST if isinstance(tool, DataError) else spindle_at_speed(table, tool, machine, logbook.cuts)
    now = said.get("speed_rpm") or present_speed(machine, table.tool)
    return recommend(table, tool, machine, at_speed, either, said.get("depth_mm"), now)
