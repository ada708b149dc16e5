"""The end of a live test: what its committed tap says of the spindle."""

from __future__ import annotations

from acquisition import TapTest
from lobewatch.analysis.history import update_history
from lobewatch.analysis.pipeline import Measurement
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.outcome import outcome_of
from lobewatch.tap.state import Outcome


def finish(folder: MachineFolder, tap: TapTest, *, guided: bool) -> tuple[Measurement, Outcome | None]:
    """Commit a tap test, bring the history up to date, and say what it means where somebody wants to read it."""
    folder.commit(tap)
    history, measurements = update_history(folder)
    measurement = next(found for found in measurements if found.tap_id == tap.id)
    return measurement, outcome_of(measurement, history, folder.machine) if guided else None
