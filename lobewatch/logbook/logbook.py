"""The logbook of one machine: its tap tests and all that follows from them, each worked out once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Self

from acquisition import UNSAID, Conditions, Description, Remark, TapTest
from lobewatch.cuts.learning.at_speed import judge_at_speed
from lobewatch.decay.standing import Standing, stand
from lobewatch.history.assembling import first_like, or_reason
from lobewatch.history.history_cache import HistoryCache
from lobewatch.history.kept_rows import of_older_versions
from lobewatch.history.tap_measurements import TapMeasurements
from lobewatch.history.usable_taps import (Result, UsableTaps)
from lobewatch.history.history import History, without_last_word
from lobewatch.logbook.replaying.store import ReplayOutcome, store_recordings
from lobewatch.machine import Machine, MachineFolder, TapEntry
from lobewatch.machine.archive.verify import enter_explained
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.measuring.measurement import Measurement, TapFit
from lobewatch.measuring.questions.accepting import accept
from lobewatch.measuring.questions.clock import clock_questions
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.advice import Advice, advise
from lobewatch.verdicts.critical import is_missing, ruling_of
from lobewatch.verdicts.verdict import Ruling, Verdict


class Logbook:
    """One machine. Reading brings history.rows up to date where its lock can be had, else works in memory and says so.

    It holds what the disk said when it was first asked; `commit` and `replay` add to it, `is_current` tells whether
    somebody else has.
    """

    def __init__(self, folder: MachineFolder) -> None:
        """Nothing is read yet."""
        self.folder = folder
        self.files = UsableTaps(folder)
        """What the folder holds, and what was done to the machine."""
        self._said: list[Remark] = []
        self._mark, self._cache = folder.mark, HistoryCache(folder)
        self._history: History | None = None
        self._worked_out: TapMeasurements | None = None
        self.fits: dict[str, TapFit] = {}
        self.judged: dict[str | None, dict[str, Verdict]] = {}
        """By tap test: its modes, and the verdict on each program as it was then, where others have worked them out."""

    @classmethod
    def open(cls, path: Path | str) -> Self:
        """The logbook of a machine folder; DataError where it is none."""
        return cls(MachineFolder(path))

    @property
    def machine(self) -> Machine:
        """machine.toml."""
        return self.folder.machine

    @property
    def remarks(self) -> list[Remark]:
        """What is to be said of the files themselves."""
        return [*self.files.remarks, *self._said, *of_older_versions(self._history)]

    @property
    def is_current(self) -> bool:
        """Whether journal and machine.toml are as they were then."""
        return self.folder.mark == self._mark

    @property
    def taps(self) -> Sequence[TapEntry]:
        """The committed tap tests whose files can be used, oldest first by their time."""
        return [place.entry for place in self.files.places]

    @property
    def cuts(self) -> tuple[HeardCut, ...]:
        """The test cuts that something can be learnt from, oldest first."""
        return tuple(cut for cut in self.files.cuts if cut.counts)

    def series(self, tool: str, direction: str) -> list[TapEntry]:
        """Tap tests of one tool and direction, oldest first."""
        return [tap for tap in self.taps if (tap.tool, tap.direction) == (tool, direction)]

    def newest(self, tool: str | None = None) -> TapEntry:
        """The newest tap test, of a tool where one is named; DataError where there is none."""
        return self.files.newest(tool)

    def commit(self, tap: TapTest, now: datetime | None = None) -> None:
        """Add a tap test; saved for good when this returns. now: of a live test, whose time is then asked about."""
        if not self.is_current:
            self._forget()
        asked = clock_questions(tap.circumstances.created, now, (one.entry for one in self.files.places[-1:]))
        self._forget_results(goes_on=self.files.add(self.folder.commit(tap, asked)))
        self._mark = self.folder.mark

    def replay(
        self,
        file: Path | str,
        date: datetime | None = None,
        tool: str = "",
        direction: str = "",
        conditions: Conditions = UNSAID,
        **said: Any,
    ) -> Measurement:
        """Store a recorded file as a tap test, unless it is stored already, and say what it means.

        date, tool, direction, conditions and the other fields of `acquisition.Description` (unit="g/N") say what the
        file does not. DataError for a file that cannot be trusted, or does not say enough, with the reason.
        """
        described = Description(date=date, tool=tool, direction=direction, conditions=conditions, **said)
        (tap_id,) = self.replay_all([Path(file)], described).tap_ids
        self.files.refuse_excluded(tap_id)
        return self.measurement(tap_id)

    def replay_all(self, files: Sequence[Path], said: Description, **how: Any) -> ReplayOutcome:
        """Store recorded files, each once; how: workers, keep_going and progress of `store_recordings`."""
        with self.folder.locked():
            enter_explained(self.folder)  # else what an interrupted replay has stored would be stored twice
            stored = store_recordings(self.folder, files, said, **how)
            self.fits |= stored.fits
            self._forget()
        return stored

    def measurement(self, tap_id: str) -> Measurement:
        """What a tap test says, worked out once; KeyError for a tap test that is not in the journal or is left out."""
        return self._all.measured(self.files.place(tap_id), self.history.rows)

    @property
    def history(self) -> History:
        """All measurements in order of time, up to date; on the disk too where that could be written."""
        return self.from_the_rest(self._known_history)

    def assembly(self, tool: str | None = None, until: str | None = None) -> Assembly:
        """The newest x and y of a tool (None: of the newest tap test), as they were after the tap test `until`.

        Predicted by the model where the tool was not tapped by then; DataError where there is no model of it.
        """
        return self.from_the_rest(lambda: self._assembly(tool, until))

    def first_assembly(self, now: Assembly) -> Assembly | None:
        """The earliest of the same tool that knows the same directions; None where that is itself or a prediction."""
        return self.from_the_rest(lambda: first_like(now, self.files.since(now.tap_id), self.questions, self.assembly))

    def verdicts(self, until: str | None = None, names: Collection[str] | None = None) -> list[Verdict]:
        """One a program (of these names), from the newest tap tests of its tool as they were after the test `until`."""
        return self.from_the_rest(lambda: self._judged(until, names))

    def _judged(self, until: str | None, names: Collection[str] | None) -> list[Verdict]:
        tables = [table for table in self.machine.program if names is None or table.name in names]
        rows = self.history.rows
        until = rows[-1].tap_id if until is None and self.history.current else until
        judged = self.judged.setdefault(until, {})
        missing = [table for table in tables if table.name not in judged]
        known = {tool: or_reason(partial(self.assembly, tool, until)) for tool in {one.tool for one in missing}}
        cuts = self.cuts if until in (None, *(row.tap_id for row in rows[-1:])) else ()
        judged |= {one.name: judge_at_speed(one, known[one.tool], self.machine, cuts) for one in missing}
        return [judged[table.name] for table in tables]

    def rulings(self, tap_id: str, falls: bool = False) -> Mapping[str, Ruling]:
        """Word, limit and critical `falls` of every program after a tap test; the history keeps what was asked for."""
        known = self.history.rows[number := self.files.place(tap_id).number].rulings
        found = dict(known or {})
        names = [one.name for one in self.machine.program if is_missing(found.get(one.name), falls)]
        if names or known is None:
            found |= {one.program.name: ruling_of(one, falls) for one in self.verdicts(tap_id, names)}
            found = {table.name: found[table.name] for table in self.machine.program}
            self._history = self.history.with_rulings(number, found)
            said = self._cache.store(without_last_word(self._history) if self.files.doubts() else self._history)
            self._said += [remark for remark in said if remark not in self._said]
        return found

    def ruling_then(self, now: Verdict) -> Ruling | None:
        """Word and limit of a program at the first tap tests of its tool in the same directions; None without them."""
        return self.from_the_rest(lambda: self._ruling_then(now))

    def _ruling_then(self, now: Verdict) -> Ruling | None:
        then = None if now.assembly is None else self.first_assembly(now.assembly)
        return None if then is None else self.rulings(then.tap_id)[now.program.name]

    def advice(self, found: Verdict) -> Advice:
        """What goes beyond a verdict; it takes longer than the verdict itself."""
        return advise(found, self.machine)

    def standing(self, now: datetime | None = None) -> Standing:
        """The light of the machine, the reasons, and one next step."""
        now, files = now or datetime.now(UTC), self.files
        return stand(self.machine, self.history, now, self.folder.path, files.remarks, files.event_times)

    @property
    def questions(self) -> Mapping[str, tuple[str, ...]]:
        """Codes of what is asked and not answered, by tap test; what --accept takes."""
        return self.history.questions

    def accept(self, tap_ids: Sequence[str], codes: Sequence[str]) -> list[str]:
        """Accept what is asked of these tap tests, for good; the codes that none of them asks."""
        unasked = accept(self.folder, self.questions, tap_ids, codes) if codes else []
        if len(unasked) < len(codes):
            self._forget()
        return unasked

    @property
    def calibrated(self) -> Measurement | None:
        """The newest measurement that the bearings of the model could be found from; None where there is none."""
        newest = self.history.newest_calibrated
        return None if newest is None else self.measurement(newest.tap_id)

    def from_the_rest(self, work: Callable[[], Result]) -> Result:
        """What some work gives; where it meets a damaged tap file, all of it again without that."""
        return self.files.from_the_rest(work, self._forget_results)

    def _forget(self) -> None:
        """What a new tap test alters."""
        self.files.forget()
        self._forget_results()
        self._mark = self.folder.mark

    def _forget_results(self, goes_on: bool = False) -> None:
        self._history, self.judged, self._worked_out = None, {}, self._worked_out if goes_on else None

    def _known_history(self) -> History:
        if self._history is None:
            self._history = self._up_to_date()
            if self._history.rows:
                self.rulings(self._history.rows[-1].tap_id)
        return self._history

    def _up_to_date(self) -> History:
        """The stored rows as far as they still hold, and those that are missing."""
        history = self._cache.read(self.files)
        history = replace(history, rows=self._all.with_all(history.rows, self._cache.others, self._cache.behind))
        return without_last_word(history) if history.rows and self.files.doubts() else history

    def _assembly(self, tool: str | None, until: str | None) -> Assembly:
        known = self.files.until(until)
        if not known:
            self.newest(tool)
        tool, rows = known[-1].entry.tool if tool is None else tool, self.history.rows
        found = self._all.tool_in(known, rows, tool)
        doubts = self.files.doubts("" if found.predicted else tool) if known[-1] is self.files.places[-1] else ()
        return replace(found, questions=(*found.questions, *doubts))

    @property
    def _all(self) -> TapMeasurements:
        if self._worked_out is None:
            self._worked_out = TapMeasurements(self.folder, self.files.places, self.fits)
        return self._worked_out
