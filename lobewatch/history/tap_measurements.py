"""Measurements and history rows of all tap tests of a machine."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from acquisition import CROSS_TAP, DataError
from lobewatch.history.history import HistoryRow, keep_older_row, make_row
from lobewatch.history.row_reuse import FollowedModeIndex, ReusableRows
from lobewatch.history.usable_taps import NotTappedError
from lobewatch.machine import DamagedTapError, MachineFolder, TapEntry
from lobewatch.measurement.recording_questions import find_open_questions, mark_accepted
from lobewatch.measurement.tap_measurement import Measurement, TapFit, interpret_fit, measure
from lobewatch.tool.assembly import Assembly, assemble, predict_assembly
from lobewatch.tool.tap_series import FollowedMode, TapPlace, iterate_earlier

MAX_MEASUREMENTS_IN_MEMORY = 500
"""Largest number of measurements in memory, those used last."""


class TapMeasurements:
    """Measurements and assemblies of a machine; rows: at least the history before a place.

    Raises DamagedTapError for a damaged file.
    """

    def __init__(self, folder: MachineFolder, places: Sequence[TapPlace], fits: Mapping[str, TapFit]) -> None:
        self._folder, self._places, self._fits = folder, places, fits
        self._measurements: dict[str, Measurement] = {}
        self._followed = FollowedModeIndex()

    def measurement(self, place: TapPlace, rows: Sequence[HistoryRow]) -> Measurement:
        """Return the measurement of one tap test."""
        measurement = self._measurements.pop(place.entry.id, None)
        if measurement is None:
            before = (rows[number] for number in iterate_earlier(place, self._places))
            last = next((row.mode for row in before if row.mode is not None and not row.questions), None)
            fit, machine = self._fits.get(place.entry.id), self._folder.machine
            if fit is None:
                measurement = measure(self._folder.read(place.entry), machine, last, place.entry.by_hand)
            else:
                measurement = interpret_fit(fit, machine, last)
            remarks = mark_accepted((*measurement.remarks, *place.remarks), place.entry)
            measurement = replace(measurement, remarks=remarks)
        self._measurements[place.entry.id] = measurement
        if len(self._measurements) > MAX_MEASUREMENTS_IN_MEMORY:
            del self._measurements[next(iter(self._measurements))]
        return measurement

    def assembly_after(self, place: TapPlace, rows: Sequence[HistoryRow]) -> Assembly:
        """Return the tool as known after one tap test."""
        cross = None if place.cross is None else self.measurement(self._places[place.cross], rows)
        if place.entry.direction == CROSS_TAP and place.other_direction is not None:
            place = self._places[place.other_direction]
        newest = self.measurement(place, rows)
        other = None if place.other_direction is None else self.measurement(self._places[place.other_direction], rows)
        series, mode = self._followed.before(place, rows), newest.followed
        if mode is not None and not find_open_questions(newest.remarks):
            values = mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg
            series.setdefault(newest.direction, []).append(FollowedMode(newest.time, *values))
        return assemble(newest, other, series, cross)

    def assembly_of(self, tool: str, places: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> Assembly:
        """Return the tool as known after the newest of these tap tests, or its prediction.

        Raises NotTappedError if it cannot be predicted.
        """
        newest = next((place for place in reversed(places) if place.entry.tool == tool), None)
        return self._prediction(tool, places, rows) if newest is None else self.assembly_after(newest, rows)

    def _prediction(self, tool: str, places: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> Assembly:
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
            return predict_assembly(self._folder.machine, list(newest.values()), tool)
        except DataError as error:
            raise NotTappedError(f"no tap test with tool {tool!r}, and no prediction: {error}") from error

    def all_rows(
        self, rows: Sequence[HistoryRow], older_rows: Mapping[str, HistoryRow], behind: ReusableRows | None = None
    ) -> tuple[HistoryRow, ...]:
        """Return these rows and those of all later tap tests.

        older_rows: rows of older versions by tap test, for tests that cannot be analysed; behind: rows that may stay
        valid.
        """
        rows = list(rows)
        for place in self._places[len(rows) :]:
            row = behind.find(place, self._places, rows) if behind is not None else None
            if row is None:
                row = self._row(place, rows, older_rows)
                if behind is not None:
                    behind.note(row)
            rows.append(row)
        return tuple(rows)

    def _row(self, place: TapPlace, rows: Sequence[HistoryRow], older_rows: Mapping[str, HistoryRow]) -> HistoryRow:
        try:
            assembly = self.assembly_after(place, rows)
            return make_row(self.measurement(place, rows), assembly, place)
        except DamagedTapError:
            raise
        except (ArithmeticError, LookupError, ValueError) as error:
            if place.entry.id not in older_rows:
                raise
            return keep_older_row(older_rows[place.entry.id], place, error)


def measure_excluded_taps(
    folder: MachineFolder, excluded: Sequence[TapEntry], rows: Sequence[HistoryRow]
) -> list[HistoryRow]:
    """Measure the excluded tap tests of a series as rows without lobes; damaged ones are skipped.

    rows: rows of the series, at least one. A tap test before its baseline is left out.
    """
    rows_out, (tool, direction, baseline) = [], (rows[-1].tool, rows[-1].direction, rows[-1].baseline)
    for entry in [entry for entry in excluded if (entry.tool, entry.direction) == (tool, direction)]:
        try:
            tap = folder.read(entry)
        except DamagedTapError:
            continue
        time = tap.circumstances.created
        if baseline is None or time >= baseline:
            before = [row.mode for row in rows if row.time < time and row.mode is not None]
            measurement = measure(tap, folder.machine, before[-1] if before else None)
            place = TapPlace(0, entry, None, None, baseline)
            rows_out.append(make_row(measurement, assemble(measurement, None, {}), place))
    return rows_out
