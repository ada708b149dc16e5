"""What follows from the tap tests of one machine, each answer worked out once."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime

from lobewatch.cuts.learning.verdict_at_speed import evaluate_at_speed
from lobewatch.history.history import History, clear_newest_verdicts
from lobewatch.history.history_cache import HistoryCache
from lobewatch.history.tap_measurements import TapMeasurements
from lobewatch.history.usable_taps import NotTappedError, UsableTaps
from lobewatch.machine import Machine, MachineFolder, ProgramTable, TapEntry
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.measurement.tap_measurement import Measurement
from lobewatch.monitoring.machine_status import MachineStatus, assess_status
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.frequency_drop import build_stored_verdict, is_verdict_missing
from lobewatch.verdicts.recommendation import Advice, advise
from lobewatch.verdicts.verdict import StoredVerdict, Verdict

MAX_CACHED_VERDICT_SETS = 8
"""Tap tests whose verdicts are kept in memory, those asked for last."""


class Analysis:
    """Answers from the files of a machine as they were when it was made, with those tap tests that can be used.

    DamagedTapError ends a question that meets a damaged file: `Logbook.ask` asks it again of an analysis without that.
    """

    def __init__(
        self, folder: MachineFolder, files: UsableTaps, cache: HistoryCache, measurements: TapMeasurements
    ) -> None:
        """Nothing is worked out yet."""
        self.folder, self.files, self.measurements = folder, files, measurements
        self._cache = cache
        self._history: History | None = None
        self._verdicts: dict[str | None, dict[str, Verdict]] = {}

    @property
    def machine(self) -> Machine:
        """machine.toml."""
        return self.folder.machine

    @property
    def taps(self) -> Sequence[TapEntry]:
        """The committed tap tests whose files can be used, oldest first by their time."""
        return [place.entry for place in self.files.places]

    @property
    def cuts(self) -> tuple[CutEntry, ...]:
        """The test cuts that something can be learnt from, oldest first."""
        return tuple(cut for cut in self.files.cuts if cut.is_usable)

    @property
    def history(self) -> History:
        """All measurements in order of time, up to date; on the disk too where that could be written."""
        if self._history is None:
            self._history = self._update_history()
            if self._history.rows:
                self.stored_verdicts(self._history.rows[-1].tap_id)
        return self._history

    @property
    def cached_history(self) -> History | None:
        """The history; None where nobody has asked for it."""
        return self._history

    def _update_history(self) -> History:
        """The stored rows as far as they still hold, and those that are missing."""
        history = self._cache.read(self.files)
        rows = self.measurements.all_rows(history.rows, self._cache.other_rows, self._cache.reusable)
        history = replace(history, rows=rows)
        return clear_newest_verdicts(history) if history.rows and self.files.newest_damaged_remarks() else history

    def measurement(self, tap_id: str) -> Measurement:
        """What a tap test says; KeyError for one that is not in the journal or is left out."""
        rows = self.history.rows
        return self.measurements.measurement(self.files.place(tap_id), rows)

    @property
    def calibrated_measurement(self) -> Measurement | None:
        """The newest measurement that the bearings of the model could be found from; None where there is none."""
        newest = self.history.newest_calibrated
        return None if newest is None else self.measurement(newest.tap_id)

    def assembly(self, tool: str | None = None, until: str | None = None) -> Assembly:
        """The newest x and y of a tool (None: of the newest tap test), as they were after the tap test `until`.

        Predicted by the model where the tool was not tapped by then; DataError where there is no model of it.
        """
        places = self.files.list_until(until)
        if not places:
            self.files.newest(tool)
        tool, rows = places[-1].entry.tool if tool is None else tool, self.history.rows
        assembly = self.measurements.assembly_of(tool, places, rows)
        is_now = places[-1] is self.files.places[-1]
        doubts = self.files.newest_damaged_remarks("" if assembly.predicted else tool) if is_now else ()
        return replace(assembly, questions=(*assembly.questions, *doubts))

    def assembly_or_reason(self, tool: str, until: str | None = None) -> Assembly | NotTappedError:
        """A tool as `assembly` has it, or why it is not known."""
        try:
            return self.assembly(tool, until)
        except NotTappedError as error:
            return error

    def first_assembly(self, now: Assembly) -> Assembly | None:
        """The earliest of the same tool that knows the same directions; None where that is itself or a prediction."""
        for tap in self._earlier_taps(now):
            then = self.assembly(tap.tool, tap.id)
            if then.directions == now.directions:
                return then
        return None

    def _earlier_taps(self, now: Assembly) -> Iterator[TapEntry]:
        """Tap tests of the same tool, without questions, from which on all its directions may have been known."""
        directions, questions = set[str](), self.history.questions
        for tap in self.files.list_series(now.tap_id):
            if tap.id == now.tap_id:
                return
            if tap.tool == now.tool and tap.id not in questions:
                directions.add(tap.direction)
                if directions >= set(now.directions):
                    yield tap

    def verdicts(self, until: str | None = None, names: Collection[str] | None = None) -> list[Verdict]:
        """One a program (of these names), from the newest tap tests of its tool as they were after the test `until`."""
        tables = [table for table in self.machine.program if names is None or table.name in names]
        rows = self.history.rows
        until = rows[-1].tap_id if until is None and self.history.current else until
        verdicts = self._cached_verdicts(until)
        missing = [table for table in tables if table.name not in verdicts]
        tools = {tool: self.assembly_or_reason(tool, until) for tool in {table.tool for table in missing}}
        cuts = self.cuts if until in (None, *(row.tap_id for row in rows[-1:])) else ()
        verdicts |= {table.name: evaluate_at_speed(table, tools[table.tool], self.machine, cuts) for table in missing}
        return [verdicts[table.name] for table in tables]

    def verdict_for(self, table: ProgramTable) -> Verdict:
        """The verdict on a program that machine.toml does not hold, from the newest tap tests of its tool."""
        return evaluate_at_speed(table, self.assembly_or_reason(table.tool), self.machine, self.cuts)

    def _cached_verdicts(self, tap_id: str | None) -> dict[str, Verdict]:
        """Verdicts that are kept, by program."""
        verdicts = self._verdicts[tap_id] = self._verdicts.pop(tap_id, {})
        if len(self._verdicts) > MAX_CACHED_VERDICT_SETS:
            del self._verdicts[next(iter(self._verdicts))]
        return verdicts

    def stored_verdicts(
        self, tap_id: str, drops: bool = False, verdicts: Mapping[str, Verdict] | None = None
    ) -> Mapping[str, StoredVerdict]:
        """Word, limit and critical `drops` of every program after a tap test; the history keeps what was asked for.

        verdicts: by program, where others have worked them out.
        """
        stored = self.history.rows[number := self.files.place(tap_id).number].verdicts
        rulings = dict(stored or {})
        names = [table.name for table in self.machine.program if is_verdict_missing(rulings.get(table.name), drops)]
        if names or stored is None:
            judged = [verdicts[name] for name in names] if verdicts else self.verdicts(tap_id, names)
            rulings |= {verdict.program.name: build_stored_verdict(verdict, drops) for verdict in judged}
            rulings = {table.name: rulings[table.name] for table in self.machine.program}
            self._history = self.history.with_verdicts(number, rulings)
            self._cache.store(
                clear_newest_verdicts(self._history) if self.files.newest_damaged_remarks() else self._history
            )
        return rulings

    def initial_verdict(self, now: Verdict) -> StoredVerdict | None:
        """Word and limit of a program at the first tap tests of its tool in the same directions; None without them.

        None for a program that machine.toml does not hold.
        """
        if now.program.name not in self.machine.cut_names:
            return None
        tap_id = None if now.assembly is None else self._first_tap_id(now.assembly)
        return None if tap_id is None else self.stored_verdicts(tap_id)[now.program.name]

    def _first_tap_id(self, now: Assembly) -> str | None:
        """The tap test of `first_assembly`: without reading a file where its row holds both directions."""
        if len(now.directions) < 2:
            then = self.first_assembly(now)
            return None if then is None else then.tap_id
        rows = ((tap.id, self.history.rows[self.files.place(tap.id).number]) for tap in self._earlier_taps(now))
        return next((tap_id for tap_id, row in rows if row.x and row.y and row.x != row.y), None)

    def advice(self, verdict: Verdict) -> Advice:
        """What goes beyond a verdict; it takes longer than the verdict itself."""
        return advise(verdict, self.machine)

    def status(self, now: datetime | None = None) -> MachineStatus:
        """The light of the machine, the reasons, and one next step."""
        now, files = now or datetime.now(UTC), self.files
        words = files.acknowledgements, files.fleet_scatter
        return assess_status(self.machine, self.history, now, self.folder.path, files.remarks, *words)
