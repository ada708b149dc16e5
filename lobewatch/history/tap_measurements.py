"""Usable tap tests of a machine, their measurements and history rows, and stored rows that stay valid after a change.

A result depends on its own file, on the followed mode before it, and in the other direction on the test that it is
taken from. So after an old tap test is added or excluded, only its neighbours are analysed again.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime

from acquisition import CROSS_TAP, DataError, Remark
from acquisition.errors import join_sentences
from lobewatch.history.history import HistoryRow, ModeValues, encode_row, keep_older_row, make_row
from lobewatch.history.series_reference import EarlierTestIndex, find_row_questions
from lobewatch.machine import DamagedTapError, MachineFolder, TapEntry
from lobewatch.machine.folder import FolderContents
from lobewatch.machine.journal.alarm_entries import FleetScatter
from lobewatch.machine.journal.journal import format_command
from lobewatch.measurement import recording_questions as questions
from lobewatch.measurement.hit_choice import format_decisions
from lobewatch.measurement.series_questions import MAX_DAY
from lobewatch.measurement.tap_measurement import Measurement, TapFit, interpret_fit, measure
from lobewatch.tool.assembly import Assembly, assemble, predict_assembly
from lobewatch.tool.tap_series import FollowedMode, TapOrder, TapPlace, iterate_earlier

EARLIEST_TIME = datetime.min.replace(tzinfo=UTC)
"""Time before all tap tests."""


class NotTappedError(DataError):
    """Raised when a tool was neither tapped nor can be predicted."""


class UsableTaps:
    """Contents of a machine folder, read once."""

    def __init__(self, folder: MachineFolder) -> None:
        self._folder = folder
        self._contents: FolderContents | None = None
        self._order: TapOrder | None = None
        self._left_out: dict[str, tuple[TapEntry, Remark]] = {}

    @property
    def contents(self) -> FolderContents:
        """Contents of the folder: tap tests, events, test cuts and acknowledgements."""
        if self._contents is None:
            self._contents = self._folder.contents()
        return self._contents

    @property
    def places(self) -> Sequence[TapPlace]:
        """Usable tap tests, oldest first; newer ones are added to the same sequence."""
        if self._order is None:
            usable = [tap for tap in self.contents.taps if tap.id not in self._left_out and not tap.excluded]
            self._order = TapOrder(self.contents.baselines, usable)
        return self._order.places

    def place(self, tap_id: str) -> TapPlace:
        """Return the place of a tap test; KeyError for an unknown one."""
        for place in reversed(self.places):
            if place.entry.id == tap_id:
                return place
        raise KeyError(tap_id)

    def refuse_excluded(self, tap_id: str) -> None:
        """Raise DataError for an excluded tap test."""
        for tap in [tap for tap in self.excluded if tap.id == tap_id]:
            cure = f"Run {format_command('include', self._folder.path)} {tap_id} to use the test again."
            raise DataError(f"{tap_id}: tap test stored already, but excluded ({tap.excluded!r}). {cure}")

    def list_until(self, tap_id: str | None) -> list[TapPlace]:
        """Return the tap tests up to one of them since its baseline; None: up to now."""
        last = None if tap_id is None else self.place(tap_id)
        baseline = self.baseline if last is None else last.baseline
        places = self.places if last is None else self.places[: last.number + 1]
        return [place for place in places if place.baseline == baseline]

    def list_series(self, tap_id: str) -> list[TapEntry]:
        """Return the tap tests of the same series; empty for a prediction."""
        series = {place.entry.id: place.series for place in self.places}
        return [place.entry for place in self.places if place.series == series.get(tap_id)]

    @property
    def remarks(self) -> list[Remark]:
        """Damage that is known so far."""
        of_files = () if self._contents is None else self._contents.remarks
        return [*of_files, *(remark for _, remark in self._left_out.values())]

    @property
    def fleet_scatter(self) -> FleetScatter | None:
        """First scatter of the fleet since the baseline; None without one."""
        baseline, scatters = self.baseline, self.contents.fleet_scatters
        return next((scatter for scatter in scatters if baseline is None or scatter.time >= baseline), None)

    @property
    def excluded(self) -> Sequence[TapEntry]:
        """Excluded tap tests, oldest first."""
        return [tap for tap in self.contents.taps if tap.excluded]

    @property
    def lost(self) -> Sequence[TapEntry]:
        """Tap tests with unusable files, excluded ones not included."""
        lost = [*self.contents.lost, *(entry for entry, _ in self._left_out.values())]
        return [entry for entry in lost if not entry.excluded]

    @property
    def by_id(self) -> dict[str, TapEntry]:
        """All tap tests of the journal by identity."""
        return {entry.id: entry for entry in (*self.contents.taps, *self.contents.lost)}

    @property
    def baseline(self) -> datetime | None:
        """Newest baseline."""
        return max(self.contents.baselines, default=None)

    def newest(self, tool: str | None) -> TapEntry:
        """Return the newest tap test since the baseline, of a tool if named; NotTappedError without one."""
        current = [place.entry for place in self.places if place.baseline == self.baseline]
        if fitting := [tap for tap in current if tool in (None, tap.tool)]:
            return fitting[-1]
        tool_text = "" if tool is None else f" with tool {tool!r}"
        if damaged := [str(remark) for remark in self.remarks]:
            raise NotTappedError(join_sentences(f"{self._folder.path}: no usable tap test{tool_text}", *damaged))
        cure = "Take a tap test with session.TapSession, or replay a recorded file."
        since = "yet" if self.baseline is None else f"since the new baseline of {self.baseline.astimezone():%Y-%m-%d}"
        if self.excluded:
            since += f" ({len(self.excluded)} excluded)"
            cure += f" Run {format_command('include', self._folder.path)} TAP to use an excluded test."
        raise NotTappedError(f"{self._folder.path}: no tap test{tool_text} {since}. {cure}")

    def newest_damaged_remarks(self, tool: str = "") -> tuple[Remark, ...]:
        """Return remarks on damaged tap tests that are newer than all usable ones of their series."""
        if not self.lost:
            return ()
        usable = {(place.entry.tool, place.entry.direction): place.entry.created for place in self.places}
        since = self.baseline or EARLIEST_TIME
        lost = [entry for entry in self.lost if entry.created >= since and tool in ("", entry.tool)]
        newer = [entry for entry in lost if entry.created > usable.get((entry.tool, entry.direction), EARLIEST_TIME)]
        text = "the file of this test, the newest of its tool and direction, is damaged"
        return tuple(Remark("newest-damaged", f"tap test {entry.id}", text, "Tap again") for entry in newer)

    def add(self, entry: TapEntry) -> bool:
        """Add a newly committed tap test, and tell whether it is the newest and all others are unchanged.

        After a change by another program everything is read again.
        """
        if self._contents is None or self._folder.journal.line_count != self._contents.line_count + 1:
            self.forget()
            return False
        self._contents = self._contents.with_tap(entry)
        if self._order is None or self._contents.taps[-1] is not entry:
            self._order = None
            return False
        self._order.add(entry)
        return True

    def forget(self) -> None:
        """Read the folder again at the next use."""
        self._contents = self._order = None

    def leave_out(self, error: DamagedTapError) -> None:
        """Leave out a tap test with a damaged file; the error again if it was left out before."""
        if error.entry.id in self._left_out:
            raise error
        self._left_out[error.entry.id] = error.entry, error.remark
        self._order = None


class FollowedModeIndex:
    """Index of the followed modes of rows, each row read once."""

    def __init__(self) -> None:
        self._modes: dict[str, dict[str, list[FollowedMode]]] = {}
        self._numbers: dict[str, dict[str, list[int]]] = {}
        self._rows = 0

    def before(self, place: TapPlace, rows: Sequence[HistoryRow]) -> dict[str, list[FollowedMode]]:
        """Return the earlier modes of the series of a tap test by direction; rows: at least the history before it."""
        for number, row in enumerate(rows[self._rows :], self._rows):
            if math.isfinite(row.frequency.value) and not row.questions:
                mode = FollowedMode(row.time, *row.followed)
                self._modes.setdefault(row.series, {}).setdefault(row.direction, []).append(mode)
                self._numbers.setdefault(row.series, {}).setdefault(row.direction, []).append(number)
        self._rows = max(self._rows, len(rows))
        numbers = self._numbers.get(place.series, {})
        earlier: dict[str, list[FollowedMode]] = {"x": [], "y": []}
        for direction, modes in self._modes.get(place.series, {}).items():
            earlier[direction] = modes[: bisect_left(numbers[direction], place.number)]
        return earlier


def is_row_of(row: HistoryRow, place: TapPlace) -> bool:
    """Tell whether a row is of this tap test with the same baseline, answers, mode edits, hits and mass check."""
    tap, codes = place.entry, {remark.code for remark in row.remarks}
    if (questions.TOOL_COMPLIANCE.code if tap.is_mass_checked else questions.TOOL_MISMATCH_CODE) in codes:
        return False
    ground_of_row = row.tap_id, row.baseline, row.series, row.accepted, row.by_hand, row.hit_decisions
    by_person = frozenset(tap.accepted), str(tap.by_hand), format_decisions(tap.hit_decisions)
    return ground_of_row == (tap.id, place.baseline, place.series, *by_person)


_RowBasis = tuple[str, str, ModeValues | None, tuple[Remark, ...], tuple[FollowedMode, ...]]
"""Inputs of a result besides its own file: tap test of the other direction and cross FRF (empty without one), followed
mode before it, remarks on its mounting and in its series, and modes that shift an older direction."""


class _RowArchive:
    """Ordered tap tests with their rows."""

    def __init__(self, ordered: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> None:
        self.places, self.rows = ordered, rows
        self._followed, self._earlier = FollowedModeIndex(), EarlierTestIndex()

    def basis_of(self, place: TapPlace, row: HistoryRow) -> _RowBasis:
        before = (self.rows[number] for number in iterate_earlier(place, self.places))
        last = next((row.followed for row in before if math.isfinite(row.followed[0]) and not row.questions), None)
        cross = "" if place.cross is None else self.places[place.cross].entry.id
        reference = self._earlier.find_reference(place, self.places, self.rows)
        remarks = (*place.remarks, *find_row_questions(row, reference))
        if place.other_direction is None:
            return "", cross, last, remarks, ()
        other = self.places[place.other_direction].entry
        if place.entry.created - other.created <= MAX_DAY:
            return other.id, cross, last, remarks, ()
        points = self._followed.before(place, self.rows)[place.entry.direction]
        behind = bisect_right(points, other.created, key=lambda point: point.time)
        near = (*points[max(behind - 1, 0) : behind + 1], *points[-1:])
        return other.id, cross, last, remarks, near


class ReusableRows:
    """Stored rows of a former order, queried in order of time."""

    def __init__(self, rows: Sequence[HistoryRow], taps: Mapping[str, TapEntry], baselines: Sequence[datetime]) -> None:
        entries = [taps[row.tap_id] for row in rows if row.tap_id in taps]
        then = TapOrder(baselines, entries).places if len(entries) == len(rows) else []
        pairs = zip(rows, then, strict=True) if then else ()
        known = then and all((row.baseline, row.series) == (place.baseline, place.series) for row, place in pairs)
        self._then = _RowArchive(then, rows)
        self._numbers = {row.tap_id: number for number, row in enumerate(rows)} if known else {}
        self._alike: set[str] = set()
        self._now: _RowArchive | None = None

    def find(self, place: TapPlace, ordered: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> HistoryRow | None:
        """Return the row of a tap test if it stays valid, without verdicts, which depend on all rows before it.

        rows: of the tap tests before it, all passed to `note` if new.
        """
        number = self._numbers.get(place.entry.id)
        if number is None:
            return None
        if self._now is None or self._now.rows is not rows:
            self._now = _RowArchive(ordered, rows)
        row, then = self._then.rows[number], self._then.places[number]
        if row.software or not is_row_of(row, place):
            return None
        basis = self._now.basis_of(place, row)
        if basis != self._then.basis_of(then, row) or (basis[0] and not self._is_alike(basis[0], rows, place)):
            return None
        self._alike.add(row.tap_id)
        return replace(row, verdicts=None)

    def note(self, row: HistoryRow) -> None:
        """Note the row of a tap test that was analysed again."""
        number = self._numbers.get(row.tap_id)
        if number is not None and _encode_content(row) == _encode_content(self._then.rows[number]):
            self._alike.add(row.tap_id)

    def _is_alike(self, tap_id: str, rows: Sequence[HistoryRow], place: TapPlace) -> bool:
        """Tell whether the row of an earlier tap test is unchanged."""
        if tap_id in self._alike:
            return True
        number, other = self._numbers.get(tap_id), place.other_direction
        return number is not None and other is not None and rows[other] is self._then.rows[number]


def _encode_content(row: HistoryRow) -> bytes:
    return encode_row(0, replace(row, verdicts=None), {})


NO_REUSABLE_ROWS = ReusableRows((), {}, ())
"""No stored rows of a former order."""
MAX_MEASUREMENTS_IN_MEMORY = 500
"""Largest number of measurements in memory, those used last."""


class TapMeasurements:
    """Measurements and assemblies of a machine; rows: at least the history before a place.

    Raises DamagedTapError for a damaged file.
    """

    def __init__(self, folder: MachineFolder, places: Sequence[TapPlace], fits: Mapping[str, TapFit]) -> None:
        self._folder, self._places, self._fits = folder, places, fits
        self._measurements: dict[str, Measurement] = {}
        self._followed, self._earlier = FollowedModeIndex(), EarlierTestIndex()

    def measurement(self, place: TapPlace, rows: Sequence[HistoryRow]) -> Measurement:
        """Return the measurement of one tap test."""
        measurement = self._measurements.pop(place.entry.id, None)
        if measurement is None:
            before = (rows[number] for number in iterate_earlier(place, self._places))
            last = next((row.mode for row in before if row.mode is not None and not row.questions), None)
            fit, machine = self._fits.get(place.entry.id), self._folder.machine
            reference = self._earlier.find_reference(place, self._places, rows)
            by_hand = place.entry.by_hand
            if fit is None:
                measurement = measure(self._folder.read(place.entry), machine, last, by_hand, reference)
            else:
                measurement = interpret_fit(fit, machine, last, reference)
            measurement = replace(
                measurement, remarks=questions.mark_accepted((*measurement.remarks, *place.remarks), place.entry)
            )
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
        if mode is not None and not questions.find_open_questions(newest.remarks):
            values = mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg
            series.setdefault(newest.direction, []).append(FollowedMode(newest.time, *values))
        return assemble(newest, other, series, cross)

    def assembly_of(self, tool: str, places: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> Assembly:
        """Return the tool as known after the newest of these tap tests, or its prediction; NotTappedError without."""
        newest = next((place for place in reversed(places) if place.entry.tool == tool), None)
        return self._prediction(tool, places, rows) if newest is None else self.assembly_after(newest, rows)

    def _prediction(self, tool: str, places: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> Assembly:
        newest = dict[str, Measurement]()
        calibrated = [place for place in reversed(places) if rows[place.number].bearing_stiffness.is_known]
        for place in calibrated:
            row = rows[place.number]
            if row.predicts_tools and row.direction not in newest:
                newest[row.direction] = self.measurement(place, rows)
        if calibrated and not any(rows[place.number].stiffness.is_known for place in calibrated):
            text = "stiffness K is unknown (no force measured). Tap again with an instrumented hammer."
            raise NotTappedError(f"no tap test and no prediction for tool {tool!r}, because {text}")
        try:
            return predict_assembly(self._folder.machine, list(newest.values()), tool)
        except DataError as error:
            raise NotTappedError(f"no tap test and no prediction for tool {tool!r}: {error}") from error

    def all_rows(
        self, rows: Sequence[HistoryRow], older_rows: Mapping[str, HistoryRow], behind: ReusableRows
    ) -> tuple[HistoryRow, ...]:
        """Return these rows and those of all later tap tests.

        older_rows: rows of older versions by tap test, for tests that cannot be analysed; behind: rows that may stay
        valid.
        """
        rows = list(rows)
        for place in self._places[len(rows) :]:
            row = behind.find(place, self._places, rows)
            if row is None:
                row = self._row(place, rows, older_rows)
                behind.note(row)
            rows.append(row)
        return tuple(rows)

    def _row(self, place: TapPlace, rows: Sequence[HistoryRow], older_rows: Mapping[str, HistoryRow]) -> HistoryRow:
        try:
            assembly = self.assembly_after(place, rows)
            return make_row(self.measurement(place, rows), assembly, place)
        except (ArithmeticError, LookupError, ValueError) as error:
            if isinstance(error, DamagedTapError) or place.entry.id not in older_rows:
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
