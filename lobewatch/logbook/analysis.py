"""Analyze the usable tap tests of one machine, and cache each result."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from lobewatch.cuts.learning.program_learning import evaluate_at_speed
from lobewatch.history.chain_checks import ChainChecks
from lobewatch.history.history import History
from lobewatch.history.history_cache import HistoryCache
from lobewatch.history.tap_measurements import NotTappedError, TapMeasurements, UsableTaps
from lobewatch.machine import Machine, MachineFolder, ProgramTable, TapEntry
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.measurement.chain_check import ChainCheck
from lobewatch.measurement.tap_age import is_too_old, old_remark, tap_age_days, too_old_remark
from lobewatch.measurement.tap_measurement import Measurement
from lobewatch.monitoring.machine_status import MachineStatus, assess_status
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts import Advice, StoredVerdict, Verdict, advise
from lobewatch.verdicts.setting_robustness import build_stored_verdict, is_verdict_missing
from lobewatch.verdicts.verdict import apply_checks

MAX_CACHED_VERDICT_SETS = 8
"""Number of tap tests whose verdicts stay in memory, most recently used last."""


P = ParamSpec("P")
Answer = TypeVar("Answer")


def answered_by(question: Callable[Concatenate["Analysis", P], Answer]) -> Callable[Concatenate[Any, P], Answer]:
    """Make a method of the logbook that queries its analysis."""

    @wraps(question)
    def answer(logbook: Any, /, *arguments: P.args, **options: P.kwargs) -> Answer:
        found: Answer = logbook.query(question, *arguments, **options)
        return found

    return answer


class Analysis:
    """Results from the files of a machine as they were when the analysis was made.

    A method that meets a damaged tap file raises DamagedTapError. `Logbook.query` then repeats the query on a new
    analysis without that file, so ask the logbook rather than its analysis.
    """

    def __init__(
        self,
        folder: MachineFolder,
        files: UsableTaps,
        cache: HistoryCache,
        measurements: TapMeasurements,
        now: datetime | None = None,
    ) -> None:
        """Start without any result.

        Parameters
        ----------
        folder
            Folder of the machine.
        files
            Usable tap tests and journal entries.
        cache
            history.rows.
        measurements
            Measured tap tests.
        now
            Time that ages are counted to. None for the present time.
        """
        self._now = now
        self.folder, self.files, self.measurements = folder, files, measurements
        self._cache = cache
        self._history: History | None = None
        self._verdicts: dict[str | None, dict[str, Verdict]] = {}

    @property
    def now(self) -> datetime:
        """Time that ages are counted to."""
        return self._now or datetime.now(UTC)

    @property
    def machine(self) -> Machine:
        """Settings in machine.toml."""
        return self.folder.machine

    @property
    def taps(self) -> Sequence[TapEntry]:
        """Usable tap tests, oldest first."""
        return [place.entry for place in self.files.places]

    @property
    def cuts(self) -> tuple[CutEntry, ...]:
        """Usable test cuts and power readings, oldest first."""
        return tuple(cut for cut in self.files.contents.cuts if cut.is_evidence)

    @property
    def history(self) -> History:
        """Up-to-date history, oldest tap test first; history.rows is updated where the lock is free."""
        if self._history is None:
            history = self._history = self._measure_rows()
            if history.rows:
                self.stored_verdicts(history.rows[-1].tap_id)
        return self._history

    def _measure_rows(self) -> History:
        """Return the history with a row for every tap test."""
        history = self._cache.read(self.files)
        rows = self.measurements.all_rows(history.rows, self._cache.other_rows, self._cache.reusable)
        return self._without_doubtful_verdicts(replace(history, rows=rows))

    def save_rows(self) -> None:
        """Write the rows of all tap tests to history.rows, without new verdicts."""
        self._cache.store(self._measure_rows())

    @property
    def checked_history(self) -> History:
        """History whose verdicts are limited by the present checks of the sensors, to show."""
        history, checks = self.history, self.chain_checks
        rows = (replace(row, verdicts=checks.limit_verdicts(row, row.verdicts or {})) for row in history.rows)
        return replace(history, rows=tuple(rows))

    @property
    def cached_history(self) -> History | None:
        """Cached history, or None."""
        return self._history

    def _without_doubtful_verdicts(self, history: History) -> History:
        """Return the history without the verdicts after the newest tap test, if a newer one is damaged."""
        is_doubtful = history.rows and self.files.newest_damaged_remarks()
        return history.with_verdicts(len(history.rows) - 1, None) if is_doubtful else history

    def measurement(self, tap_id: str) -> Measurement:
        """Measure one tap test.

        Parameters
        ----------
        tap_id
            Identity of the tap test.

        Raises
        ------
        KeyError
            If the tap test is not in the journal or cannot be used.
        """
        return self.measurements.measurement(self.files.place(tap_id), self.history.rows)

    @property
    def calibrated_measurement(self) -> Measurement | None:
        """Newest measurement with calibrated bearings, or None."""
        rows = (row for row in reversed(self.history.current) if not row.questions and row.bearing_stiffness.is_known)
        newest = next(rows, None)
        return None if newest is None else self.measurement(newest.tap_id)

    def assembly(self, tool: str | None = None, until: str | None = None) -> Assembly:
        """Combine the newest x and y of a tool, or predict the tool by the model if it was never tapped.

        Without `until` it is as of now, with the age of its tap tests and the checks of their sensors.

        Parameters
        ----------
        tool
            Name of the tool. None for the tool of the newest tap test.
        until
            Identity of the last tap test to use. None for all tap tests.

        Raises
        ------
        NotTappedError
            If the tool was not tapped by then and the model cannot predict it.
        """
        places = self.files.list_until(until)
        if not places:
            self.files.newest(tool)
        tool, rows = places[-1].entry.tool if tool is None else tool, self.history.rows
        assembly = self.measurements.assembly_of(tool, places, rows)
        is_now = places[-1] is self.files.places[-1]
        damage = self.files.newest_damaged_remarks("" if assembly.predicted else tool) if is_now else ()
        assembly = replace(assembly, questions=(*assembly.questions, *damage))
        return self._with_checks(assembly) if until is None else assembly

    def _with_checks(self, assembly: Assembly) -> Assembly:
        """Return an assembly as of now, with the checks of its sensors and its age."""
        return self._with_age(self.chain_checks.attach(assembly))

    def _with_age(self, assembly: Assembly) -> Assembly:
        """Return an assembly with the age of its tap tests, and the remark on old ones."""
        time, now, table = self.history.tapped_since(assembly.tool), self.now, self.machine.machine
        if time is None:
            return assembly
        aged = replace(assembly, tapped_since=time, age_days=tap_age_days(time, now))
        if not is_too_old(time, now, table.interval_days):
            return aged
        if table.tap_interval_days is None:
            return replace(aged, age_remarks=(old_remark(aged.tool, time, now),))
        return replace(aged, unchecked=(*aged.unchecked, too_old_remark(aged.tool, time, now, table.interval_days)))

    @property
    def chain_checks(self) -> ChainChecks:
        """Checks of the sensors behind the tap tests."""
        files, rows = self.files, self.history.rows
        of_files = files.by_id, files.contents.mass_checks, self.folder.path
        return ChainChecks(self.machine, rows, *of_files)

    def chain_check(self, tap_id: str) -> ChainCheck:
        """Return the check of the sensors behind one tap test.

        Parameters
        ----------
        tap_id
            Identity of the tap test.
        """
        return self.chain_checks.check(tap_id)

    def assembly_or_reason(self, tool: str, until: str | None = None) -> Assembly | NotTappedError:
        """Return the assembly of a tool, or the reason why there is none.

        Parameters
        ----------
        tool, until
            As in `assembly`.
        """
        try:
            return self.assembly(tool, until)
        except NotTappedError as error:
            return error

    def first_assembly(self, now: Assembly) -> Assembly | None:
        """Return the earliest assembly of the same tool and directions, or None if there is no earlier one.

        Parameters
        ----------
        now
            Assembly to compare with.
        """
        for tap in self._earlier_taps(now):
            then = self.assembly(tap.tool, tap.id)
            if then.directions == now.directions:
                return then
        return None

    def _earlier_taps(self, now: Assembly) -> Iterator[TapEntry]:
        """Yield earlier tap tests of the tool, without open questions, once all its directions are covered."""
        directions, questions = set[str](), self.history.questions
        for tap in self.files.list_series(now.tap_id):
            if tap.id == now.tap_id:
                return
            if tap.tool == now.tool and tap.id not in questions:
                directions.add(tap.direction)
                if directions >= set(now.directions):
                    yield tap

    def verdicts(self, until: str | None = None, names: Collection[str] | None = None) -> list[Verdict]:
        """Evaluate programs on the newest tap tests of their tools.

        Without `until` the verdicts are as of now, and at most doubtful if the tap tests are too old or their sensors
        not checked.

        Parameters
        ----------
        until
            Identity of the last tap test to use. None for all tap tests.
        names
            Names of the programs. None for all programs.

        Returns
        -------
        list of Verdict
            One verdict for each program, in the order of machine.toml.
        """
        tables = [table for table in self.machine.program if names is None or table.name in names]
        rows, is_now = self.history.rows, until is None
        until = self._newest_id if is_now else until
        verdicts = self._cached_verdicts(until)
        missing = [table for table in tables if table.name not in verdicts]
        tools = {tool: self.assembly_or_reason(tool, until) for tool in {table.tool for table in missing}}
        cuts = self.cuts if until in (None, *(row.tap_id for row in rows[-1:])) else ()
        verdicts |= {table.name: evaluate_at_speed(table, tools[table.tool], self.machine, cuts) for table in missing}
        found = [verdicts[table.name] for table in tables]
        return [*map(self._as_of_now, found)] if is_now else found

    def _as_of_now(self, verdict: Verdict) -> Verdict:
        return verdict if verdict.assembly is None else apply_checks(verdict, self._with_checks(verdict.assembly))

    def verdict_for(self, table: ProgramTable) -> Verdict:
        """Evaluate a program that is not in machine.toml.

        Parameters
        ----------
        table
            Program to evaluate.
        """
        tool = self.assembly_or_reason(table.tool, self._newest_id)
        return self._as_of_now(evaluate_at_speed(table, tool, self.machine, self.cuts))

    @property
    def _newest_id(self) -> str | None:
        """Identity of the newest tap test; None without one since the baseline."""
        return self.history.rows[-1].tap_id if self.history.current else None

    def _cached_verdicts(self, tap_id: str | None) -> dict[str, Verdict]:
        """Return the cached verdicts after a tap test, by program."""
        verdicts = self._verdicts[tap_id] = self._verdicts.pop(tap_id, {})
        if len(self._verdicts) > MAX_CACHED_VERDICT_SETS:
            del self._verdicts[next(iter(self._verdicts))]
        return verdicts

    def stored_verdicts(
        self, tap_id: str, drops: bool = False, verdicts: Mapping[str, Verdict] | None = None
    ) -> Mapping[str, StoredVerdict]:
        """Return the verdict on every program after a tap test, and store the new ones in the history.

        The checks of the sensors count as they are now. They limit what is returned, not what is stored.

        Parameters
        ----------
        tap_id
            Identity of the tap test.
        drops
            Whether critical frequency drops are needed too.
        verdicts
            Verdicts evaluated elsewhere, by program.
        """
        row_verdicts = self.history.rows[number := self.files.place(tap_id).number].verdicts
        stored = dict(row_verdicts or {})
        names = [table.name for table in self.machine.program if is_verdict_missing(stored.get(table.name), drops)]
        if names or row_verdicts is None:
            new = [verdicts[name] for name in names] if verdicts else self.verdicts(tap_id, names)
            stored |= {verdict.program.name: build_stored_verdict(verdict, drops) for verdict in new}
            stored = {table.name: stored[table.name] for table in self.machine.program}
            history = self._history = self.history.with_verdicts(number, stored)
            self._cache.store(self._without_doubtful_verdicts(history))
        return self.chain_checks.limit_verdicts(self.history.rows[number], stored)

    def initial_verdict(self, now: Verdict) -> StoredVerdict | None:
        """Return the verdict on a program at the first tap tests of its tool in the same directions.

        None if there are no such tap tests or the program is not in machine.toml.

        Parameters
        ----------
        now
            Present verdict on the program.
        """
        if now.program.name not in self.machine.cut_tables:
            return None
        tap_id = None if now.assembly is None else self._first_tap_id(now.assembly)
        return None if tap_id is None else self.stored_verdicts(tap_id)[now.program.name]

    def _first_tap_id(self, now: Assembly) -> str | None:
        """Find the tap test of `first_assembly`, from one row of the history if it holds both directions."""
        if len(now.directions) < 2:
            then = self.first_assembly(now)
            return None if then is None else then.tap_id
        rows = ((tap.id, self.history.rows[self.files.place(tap.id).number]) for tap in self._earlier_taps(now))
        return next((tap_id for tap_id, row in rows if row.x and row.y and row.x != row.y), None)

    def advice(self, verdict: Verdict) -> Advice:
        """Search for better settings of a program. Slower than the verdict itself.

        Parameters
        ----------
        verdict
            Verdict on the program.
        """
        return advise(verdict, self.machine)

    def status(self, now: datetime | None = None) -> MachineStatus:
        """Assess the machine: status, reasons and one next step.

        Parameters
        ----------
        now
            Time of the assessment. None for the present time.
        """
        files, time = self.files, now or self.now
        acknowledged, scatter = files.contents.acknowledgements, files.fleet_scatter
        chain = [*self.chain_checks.newest_remarks(self.history.current)]
        of_files = files.remarks, acknowledged, scatter, chain
        return assess_status(self.machine, self.checked_history, time, self.folder.path, *of_files)
