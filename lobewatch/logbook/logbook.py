"""The logbook of one machine: its tap tests and all that follows from them, each worked out once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from acquisition import UNKNOWN_CONDITIONS, Conditions, Description, Remark, TapTest
from lobewatch.history.history import History, find_older_version_remarks
from lobewatch.history.history_cache import HistoryCache
from lobewatch.history.tap_measurements import TapMeasurements
from lobewatch.history.usable_taps import UsableTaps
from lobewatch.logbook import recordings as replaying
from lobewatch.logbook.analysis import Analysis
from lobewatch.machine import DamagedTapError, Machine, MachineFolder, ProgramTable, TapEntry
from lobewatch.machine.folder_updates import store_mode_edits
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.machine.verify_files import enter_orphaned_taps
from lobewatch.measurement.recording_questions import accept_questions, find_clock_questions
from lobewatch.measurement.tap_measurement import EDITS_NOT_APPLIED_CODE, Measurement, TapFit, fit_tap
from lobewatch.monitoring.machine_status import MachineStatus
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.recommendation import Advice
from lobewatch.verdicts.verdict import StoredVerdict, Verdict
from modal import ModeEdits

P = ParamSpec("P")
Answer = TypeVar("Answer")


class Logbook:
    """One machine. Reading brings history.rows up to date where its lock can be had, else works in memory and says so.

    It holds what the disk said when it was first asked; `commit` and `replay` add to it, `is_current` tells whether
    somebody else has. Questions are answered by `Analysis`, all through `ask`.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from lobewatch.machine import make_machine_folder
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     logbook = Logbook.open(toml.parent)
    ...     standing = logbook.standing()
    >>> standing.light.value, [reason.code for reason in standing.reasons]
    ('unknown', ['never-tapped'])
    """

    def __init__(self, folder: MachineFolder) -> None:
        """Nothing is read yet."""
        self.folder = folder
        """Folder of the machine."""
        self.files = UsableTaps(folder)
        """What the folder holds, and what was done to the machine."""
        self.fits: dict[str, TapFit] = {}
        """Modes of tap tests that others have fitted, by tap test."""
        self._mark, self._cache = folder.change_mark, HistoryCache(folder)
        self._current_analysis: Analysis | None = None

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
        history = None if self._current_analysis is None else self._current_analysis.cached_history
        return [*self.files.remarks, *self._cache.remarks, *find_older_version_remarks(history)]

    @property
    def is_current(self) -> bool:
        """Whether journal and machine.toml are as they were then."""
        return self.folder.change_mark == self._mark

    def query(
        self, question: Callable[Concatenate[Analysis, P], Answer], *arguments: P.args, **named: P.kwargs
    ) -> Answer:
        """The answer to a question; asked again where it meets a damaged tap file, of an analysis without that."""
        while True:
            try:
                return question(self._analysis, *arguments, **named)
            except DamagedTapError as error:
                self.files.leave_out(error)
                self._current_analysis = None

    @property
    def taps(self) -> Sequence[TapEntry]:
        """The committed tap tests whose files can be used, oldest first by their time."""
        return self._analysis.taps

    @property
    def cuts(self) -> tuple[CutEntry, ...]:
        """The test cuts that something can be learnt from, oldest first."""
        return self._analysis.cuts

    def series(self, tool: str, direction: str) -> list[TapEntry]:
        """Tap tests of one tool and direction, oldest first."""
        return [tap for tap in self.taps if (tap.tool, tap.direction) == (tool, direction)]

    def newest_tap(self, tool: str | None = None) -> TapEntry:
        """The newest tap test, of a tool where one is named; DataError where there is none."""
        return self.files.newest(tool)

    @property
    def history(self) -> History:
        """All measurements in order of time, up to date; on the disk too where that could be written."""
        return self.query(_get_history)

    @property
    def questions(self) -> Mapping[str, tuple[str, ...]]:
        """Codes of what is asked and not answered, by tap test; what --accept takes."""
        return self.history.questions

    def measurement(self, tap_id: str) -> Measurement:
        """What a tap test says; KeyError for one that is not in the journal or is left out, DataError where its file is
        damaged."""
        self.query(_get_history)  # what is damaged before it is found now
        return self._analysis.measurement(tap_id)

    @property
    def calibrated_measurement(self) -> Measurement | None:
        """The newest measurement that the bearings of the model could be found from; None where there is none."""
        return self.query(_get_calibrated)

    def assembly(self, tool: str | None = None, until: str | None = None) -> Assembly:
        """See `Analysis.assembly`."""
        return self.query(Analysis.assembly, tool, until)

    def verdicts(self, until: str | None = None, names: Collection[str] | None = None) -> list[Verdict]:
        """See `Analysis.verdicts`."""
        return self.query(Analysis.verdicts, until, names)

    def verdict_for(self, table: ProgramTable) -> Verdict:
        """See `Analysis.verdict_on`."""
        return self.query(Analysis.verdict_for, table)

    def stored_verdicts(self, tap_id: str, drops: bool = False) -> Mapping[str, StoredVerdict]:
        """See `Analysis.rulings`."""
        return self.query(Analysis.stored_verdicts, tap_id, drops)

    def first_assembly(self, now: Assembly) -> Assembly | None:
        """See `Analysis.first_assembly`."""
        return self.query(Analysis.first_assembly, now)

    def initial_verdict(self, now: Verdict) -> StoredVerdict | None:
        """See `Analysis.ruling_then`."""
        return self.query(Analysis.initial_verdict, now)

    def advice(self, verdict: Verdict) -> Advice:
        """What goes beyond a verdict; it takes longer than the verdict itself."""
        return self.query(Analysis.advice, verdict)

    def status(self, now: datetime | None = None) -> MachineStatus:
        """The light of the machine, the reasons, and one next step."""
        return self.query(Analysis.status, now)

    def commit(self, tap: TapTest, now: datetime | None = None) -> None:
        """Add a tap test; saved for good when this returns. now: of a live test, whose time is then asked about."""
        if not self.is_current:
            self._invalidate()
        codes = find_clock_questions(tap.circumstances.created, now, (place.entry for place in self.files.places[-1:]))
        goes_on = self.files.add(self.folder.commit(tap, codes))
        self._current_analysis = (
            self._make_analysis(self._current_analysis.measurements) if goes_on and self._current_analysis else None
        )
        self._mark = self.folder.change_mark

    def replay(
        self,
        file: Path | str,
        date: datetime | None = None,
        tool: str = "",
        direction: str = "",
        conditions: Conditions = UNKNOWN_CONDITIONS,
        **said: Any,
    ) -> Measurement:
        """Store a recorded file as a tap test, unless it is stored already, and say what it means.

        date, tool, direction, conditions and the other fields of `acquisition.Description` (unit="g/N") say what the
        file does not. DataError for a file that cannot be trusted, or does not say enough, with the reason.
        """
        description = Description(date=date, tool=tool, direction=direction, conditions=conditions, **said)
        (tap_id,) = self.replay_all([Path(file)], description).tap_ids
        self.files.refuse_excluded(tap_id)
        return self.measurement(tap_id)

    def replay_all(self, files: Sequence[Path], said: Description, **how: Any) -> replaying.ReplayOutcome:
        """Store recorded files, each once; how: workers, keep_going and progress of `store_recordings`."""
        with self.folder.locked():
            enter_orphaned_taps(self.folder)  # else what an interrupted replay has stored would be stored twice
            outcome = replaying.store_recordings(self.folder, files, said, **how)
            self.fits |= outcome.fits
            self._invalidate()
        return outcome

    def accept(self, tap_ids: Sequence[str], codes: Sequence[str]) -> list[str]:
        """Accept what is asked of these tap tests, for good; the codes that none of them asks."""
        unasked = accept_questions(self.folder, self.questions, tap_ids, codes) if codes else []
        if len(unasked) < len(codes):
            self._invalidate()
        return unasked

    def edit_modes(self, tap_ids: Sequence[str], edits: ModeEdits) -> dict[str, str]:
        """Keep what a person says of the modes of these tap tests, for good; the reasons why it cannot be of some.

        Edits that say nothing take back what was said before.
        """
        entries = {tap_id: self.files.by_id[tap_id] for tap_id in tap_ids}
        fits = {tap_id: fit_tap(self.folder.read(entry), self.machine, edits) for tap_id, entry in entries.items()}
        reasons = {
            name: said.text for name, fit in fits.items() for said in fit.remarks if said.code == EDITS_NOT_APPLIED_CODE
        }
        store_mode_edits(self.folder, [tap_id for tap_id in fits if tap_id not in reasons], edits)
        self.fits |= {tap_id: fit for tap_id, fit in fits.items() if tap_id not in reasons}
        self._invalidate()
        return reasons

    def _invalidate(self) -> None:
        """What is on the disk has changed."""
        self.files.forget()
        self._current_analysis, self._mark = None, self.folder.change_mark

    @property
    def _analysis(self) -> Analysis:
        if self._current_analysis is None:
            self._current_analysis = self._make_analysis(TapMeasurements(self.folder, self.files.places, self.fits))
        return self._current_analysis

    def _make_analysis(self, measurements: TapMeasurements) -> Analysis:
        return Analysis(self.folder, self.files, self._cache, measurements)


def _get_history(analysis: Analysis) -> History:
    return analysis.history


def _get_calibrated(analysis: Analysis) -> Measurement | None:
    return analysis.calibrated_measurement
