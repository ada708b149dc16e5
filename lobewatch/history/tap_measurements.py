"""What follows from each tap test of a machine, one after the other, each worked out once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from lobewatch.history.assembling import FollowedModes, assemble_tapped, predict_untapped
from lobewatch.history.kept_rows import kept_in_place
from lobewatch.history.still_holding import StillHolding
from lobewatch.history.history import Row, row_of
from lobewatch.machine import DamagedTapError, MachineFolder
from lobewatch.measuring.measurement import Measurement, TapFit, measure, measure_fit
from lobewatch.measuring.questions.asked import answered
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.order import Place, earlier
from modal import Mode

KEPT = 500
"""Measurements kept in memory, those asked for last."""


class TapMeasurements:
    """Measurements and assemblies of one machine from its tap files; rows: the history before a place at least."""

    def __init__(self, folder: MachineFolder, places: Sequence[Place], fits: Mapping[str, TapFit]) -> None:
        """places: all tap tests, oldest first; fits: of those that were fitted already. Nothing is worked out yet."""
        self._folder, self._places, self._fits = folder, places, fits
        self._measurements: dict[str, Measurement] = {}
        self._followed = FollowedModes()

    def measured(self, place: Place, rows: Sequence[Row]) -> Measurement:
        """What one tap test says."""
        known = self._measurements
        found = known.pop(place.entry.id, None)
        if found is None:
            before = (rows[number] for number in earlier(place, self._places))
            last = next((row.mode for row in before if row.mode is not None and not row.questions), None)
            found = self._measured(place, last)
            found = replace(found, remarks=answered((*found.remarks, *place.said), place.entry))
        known[place.entry.id] = found
        if len(known) > KEPT:
            del known[next(iter(known))]
        return found

    def _measured(self, place: Place, last: Mode | None) -> Measurement:
        fit = self._fits.get(place.entry.id)
        if fit is not None:
            return measure_fit(fit, self._folder.machine, last)
        return measure(self._folder.read(place.entry), self._folder.machine, last)

    def assembled(self, place: Place, rows: Sequence[Row]) -> Assembly:
        """The tool of one tap test as it was known then."""
        points = self._followed.before(place, rows)
        return assemble_tapped(place, self._places, points, lambda one: self.measured(one, rows))

    def tool_in(self, known: Sequence[Place], rows: Sequence[Row], tool: str) -> Assembly:
        """A tool as the newest of these tap tests with it tells, predicted where none is of it."""
        newest = next((place for place in reversed(known) if place.entry.tool == tool), None)
        if newest is not None:
            return self.assembled(newest, rows)
        return predict_untapped(self._folder.machine, known, rows, lambda place: self.measured(place, rows), tool)

    def with_all(
        self, rows: Sequence[Row], others: Mapping[str, Row], behind: StillHolding | None = None
    ) -> tuple[Row, ...]:
        """These rows, and those of all tap tests after them.

        others: rows of older versions by tap test, for those that cannot be worked out anew; behind: of those that may
        not have to be.
        """
        found = list(rows)
        for place in self._places[len(found) :]:
            held = behind.row(place, self._places, found) if behind is not None else None
            if held is not None:
                found.append(held)
                continue
            try:
                assembly = self.assembled(place, found)
                found.append(row_of(self.measured(place, found), assembly, place))
            except DamagedTapError:
                raise
            except (ArithmeticError, LookupError, ValueError) as error:
                if place.entry.id not in others:
                    raise
                found.append(kept_in_place(others[place.entry.id], place, error))
            if behind is not None:
                behind.note(found[-1])
        return tuple(found)
