"""What follows from each tap test of a machine, one after the other; each tap file is read and worked out once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from acquisition import ACROSS, DataError
from lobewatch.history.followed_modes import FollowedModes
from lobewatch.history.history import Row, row_of
from lobewatch.history.kept_rows import kept_in_place
from lobewatch.history.still_holding import StillHolding
from lobewatch.history.usable_taps import NotTappedError
from lobewatch.machine import DamagedTapError, MachineFolder
from lobewatch.measuring.measurement import Measurement, TapFit, interpret_fit, measure
from lobewatch.measuring.questions import open_questions, with_answers
from lobewatch.tool.assembly import Assembly, assemble
from lobewatch.tool.order import Place, earlier_numbers
from lobewatch.tool.prediction import predict
from lobewatch.tool.series import FollowedMode
from modal import Mode

KEPT = 500
"""Measurements kept in memory, those asked for last."""


class TapMeasurements:
    """Measurements and assemblies of one machine from its tap files; rows: the history before a place at least.

    DamagedTapError for a file that turns out to be damaged.
    """

    def __init__(self, folder: MachineFolder, places: Sequence[Place], fits: Mapping[str, TapFit]) -> None:
        """places: all tap tests, oldest first; fits: of those that were fitted already. Nothing is read yet."""
        self._folder, self._places, self._fits = folder, places, fits
        self._measurements: dict[str, Measurement] = {}
        self._followed = FollowedModes()

    def measurement(self, place: Place, rows: Sequence[Row]) -> Measurement:
        """What one tap test says."""
        measurement = self._measurements.pop(place.entry.id, None)
        if measurement is None:
            before = (rows[number] for number in earlier_numbers(place, self._places))
            last = next((row.mode for row in before if row.mode is not None and not row.questions), None)
            measurement = self._measure(place, last)
            remarks = with_answers((*measurement.remarks, *place.remarks), place.entry)
            measurement = replace(measurement, remarks=remarks)
        self._measurements[place.entry.id] = measurement
        if len(self._measurements) > KEPT:
            del self._measurements[next(iter(self._measurements))]
        return measurement

    def _measure(self, place: Place, last: Mode | None) -> Measurement:
        fit = self._fits.get(place.entry.id)
        if fit is not None:
            return interpret_fit(fit, self._folder.machine, last)
        return measure(self._folder.read(place.entry), self._folder.machine, last, place.entry.by_hand)

    def assembly_after(self, place: Place, rows: Sequence[Row]) -> Assembly:
        """The tool of one tap test as it was known then."""
        cross = None if place.cross is None else self.measurement(self._places[place.cross], rows)
        if place.entry.direction == ACROSS and place.across is not None:
            place = self._places[place.across]
        newest = self.measurement(place, rows)
        other = None if place.across is None else self.measurement(self._places[place.across], rows)
        series = self._followed.before(place, rows)
        if newest.followed is not None and not open_questions(newest.remarks):
            series.setdefault(newest.direction, []).append(_followed_mode(newest, newest.followed))
        return assemble(newest, other, series, cross)

    def assembly_of(self, tool: str, places: Sequence[Place], rows: Sequence[Row]) -> Assembly:
        """A tool as the newest of these tap tests with it tells, predicted where none is of it.

        NotTappedError where it cannot be predicted.
        """
        newest = next((place for place in reversed(places) if place.entry.tool == tool), None)
        return self._prediction(tool, places, rows) if newest is None else self.assembly_after(newest, rows)

    def _prediction(self, tool: str, places: Sequence[Place], rows: Sequence[Row]) -> Assembly:
        newest: dict[str, Measurement] = {}
        calibrated = [place for place in reversed(places) if rows[place.number].bearing_stiffness.is_known]
        for place in calibrated:
            row = rows[place.number]
            if row.stiffness.is_known and not row.questions and row.direction not in newest:
                newest[row.direction] = self.measurement(place, rows)
        if calibrated and not any(rows[place.number].stiffness.is_known for place in calibrated):
            text = "no force was measured, K is not known; tap with a hammer that measures its force"
            raise NotTappedError(f"no tap test with tool {tool!r}, and no prediction: {text}")
        try:
            return predict(self._folder.machine, list(newest.values()), tool)
        except DataError as error:
            raise NotTappedError(f"no tap test with tool {tool!r}, and no prediction: {error}") from error

    def all_rows(
        self, rows: Sequence[Row], older_rows: Mapping[str, Row], behind: StillHolding | None = None
    ) -> tuple[Row, ...]:
        """These rows, and those of all tap tests after them.

        others: rows of older versions by tap test, for those that cannot be worked out anew; behind: of those that may
        not have to be.
        """
        rows = list(rows)
        for place in self._places[len(rows) :]:
            held = behind.row(place, self._places, rows) if behind is not None else None
            if held is not None:
                rows.append(held)
                continue
            rows.append(self._row(place, rows, older_rows))
            if behind is not None:
                behind.note(rows[-1])
        return tuple(rows)

    def _row(self, place: Place, rows: Sequence[Row], older_rows: Mapping[str, Row]) -> Row:
        try:
            assembly = self.assembly_after(place, rows)
            return row_of(self.measurement(place, rows), assembly, place)
        except DamagedTapError:
            raise
        except (ArithmeticError, LookupError, ValueError) as error:
            if place.entry.id not in older_rows:
                raise
            return kept_in_place(older_rows[place.entry.id], place, error)


def _followed_mode(measurement: Measurement, mode: Mode) -> FollowedMode:
    return FollowedMode(measurement.time, mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg)
