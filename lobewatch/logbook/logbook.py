"""Open the logbook of one machine, query its analysis and add tap tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, Concatenate, Self

from acquisition import UNKNOWN_CONDITIONS, Conditions, Description, HitDecision, Remark, TapTest
from acquisition.hit_quality.decide_hits import add_decisions, decide_hits
from lobewatch.history.history import History, find_older_version_remarks
from lobewatch.history.history_cache import HistoryCache
from lobewatch.history.tap_measurements import TapMeasurements, UsableTaps
from lobewatch.logbook import recordings
from lobewatch.logbook.analysis import Analysis, Answer, P, answered_by
from lobewatch.machine import DamagedTapError, Machine, MachineFolder, TapEntry
from lobewatch.machine.folder_updates import store_hit_decisions, store_mode_edits
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.settings.display_units import shown_units
from lobewatch.machine.verify_files import enter_orphaned_taps
from lobewatch.measurement.recording_questions import accept_questions, find_clock_questions, find_device_questions
from lobewatch.measurement.tap_measurement import EDITS_NOT_APPLIED_CODE, Measurement, TapFit, fit_tap
from modal import ModeEdits

ROW_SAVING_PAUSE = 10
"""Time from one writing of the rows during a replay to the next, in times of the first; chosen."""


class Logbook:
    """Tap tests, test cuts and results of one machine.

    A logbook shows the folder as it was at the first access. `commit` and `replay` add to it, and `is_current` tells
    whether another program has changed it. Reading updates history.rows if it can lock the folder, else a remark tells.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from lobewatch.machine import make_machine_folder
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     status = Logbook.open(toml.parent).status()
    >>> status.status.value, [reason.code for reason in status.reasons]
    ('unknown', ['never-tapped'])
    """

    def __init__(self, folder: MachineFolder, now: datetime | None = None) -> None:
        """Read nothing yet. Ages are counted to `now`, None for the present time."""
        self._now = now
        self.folder = folder
        """Folder of the machine."""
        self.files = UsableTaps(folder)
        """Usable tap tests and all other entries of the journal."""
        self.fits: dict[str, TapFit] = {}
        """Modes fitted elsewhere, by tap test."""
        self._mark, self._cache = folder.change_mark, HistoryCache(folder)
        self._current_analysis: Analysis | None = None
        self._next_row_saving = 0.0

    @classmethod
    def open(cls, path: Path | str, now: datetime | None = None) -> Self:
        """Open the logbook of a machine folder.

        Parameters
        ----------
        path
            Path of the machine folder.
        now
            Time that ages are counted to. None for the present time.

        Raises
        ------
        DataError
            If there is no machine folder at this path.
        """
        return cls(MachineFolder(path), now)

    @property
    def machine(self) -> Machine:
        """Settings in machine.toml."""
        return self.folder.machine

    @property
    def analysis(self) -> Analysis:
        """Analysis of the usable tap tests."""
        if self._current_analysis is None:
            self._current_analysis = self._make_analysis(TapMeasurements(self.folder, self.files.places, self.fits))
        return self._current_analysis

    @property
    def remarks(self) -> list[Remark]:
        """Remarks on the files of the machine."""
        history = None if self._current_analysis is None else self._current_analysis.cached_history
        return [*self.files.remarks, *self._cache.remarks, *find_older_version_remarks(history)]

    @property
    def is_current(self) -> bool:
        """True if journal and machine.toml are unchanged since they were read."""
        return self.folder.change_mark == self._mark

    def query(
        self, question: Callable[Concatenate[Analysis, P], Answer], *arguments: P.args, **options: P.kwargs
    ) -> Answer:
        """Query the analysis, again without each tap file that proves to be damaged.

        Parameters
        ----------
        question
            Function of an analysis, such as `Analysis.verdicts`.
        arguments, options
            Further arguments of the function.
        """
        while True:
            try:
                with shown_units(self.machine.machine.units):
                    return question(self.analysis, *arguments, **options)
            except DamagedTapError as error:
                self.files.leave_out(error)
                self._current_analysis = None

    @property
    def taps(self) -> Sequence[TapEntry]:
        """Usable tap tests, oldest first."""
        return self.analysis.taps

    @property
    def cuts(self) -> tuple[CutEntry, ...]:
        """Usable test cuts and power readings, oldest first."""
        return self.analysis.cuts

    def series(self, tool: str, direction: str) -> list[TapEntry]:
        """Return the tap tests of one tool and direction, oldest first.

        Parameters
        ----------
        tool
            Name of the tool.
        direction
            Direction at the tool tip, "x" or "y".
        """
        return [tap for tap in self.taps if (tap.tool, tap.direction) == (tool, direction)]

    def newest_tap(self, tool: str | None = None) -> TapEntry:
        """Return the newest tap test.

        Parameters
        ----------
        tool
            Name of the tool. None for any tool.

        Raises
        ------
        NotTappedError
            If there is no such tap test.
        """
        return self.files.newest(tool)

    @property
    def history(self) -> History:
        """Up-to-date history, oldest tap test first; history.rows is updated where the lock is free."""
        return self.query(lambda analysis: analysis.history)

    @property
    def checked_history(self) -> History:
        """History whose verdicts are limited by the present checks of the sensors, to show."""
        return self.query(lambda analysis: analysis.checked_history)

    @property
    def questions(self) -> Mapping[str, tuple[str, ...]]:
        """Codes of the open questions, by tap test; `accept` answers them."""
        return self.history.questions

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
        DataError
            If its file is damaged.
        """
        _ = self.history  # finds damaged files first
        return self.analysis.measurement(tap_id)

    @property
    def calibrated_measurement(self) -> Measurement | None:
        """Newest measurement with calibrated bearings, or None."""
        return self.query(lambda analysis: analysis.calibrated_measurement)

    assembly = answered_by(Analysis.assembly)
    first_assembly = answered_by(Analysis.first_assembly)
    verdicts = answered_by(Analysis.verdicts)
    verdict_for = answered_by(Analysis.verdict_for)
    stored_verdicts = answered_by(Analysis.stored_verdicts)
    initial_verdict = answered_by(Analysis.initial_verdict)
    advice = answered_by(Analysis.advice)
    status = answered_by(Analysis.status)
    chain_check = answered_by(Analysis.chain_check)

    def commit(
        self, tap: TapTest, now: datetime | None = None, asked: Sequence[str] = (), answered: Sequence[str] = ()
    ) -> None:
        """Store a tap test permanently.

        Parameters
        ----------
        tap
            Tap test.
        now
            Time of a live test, which is checked against the clock. None for a recorded test.
        asked
            Codes of questions that the live test leaves open.
        answered
            Codes of questions that a person has answered before the first hit.
        """
        if not self.is_current:
            self._invalidate()
        newest = (place.entry for place in self.files.places[-1:])
        codes = (*find_clock_questions(tap.circumstances.created, now, newest), *asked)
        codes += find_device_questions(self.folder, tap.circumstances)
        analysis, is_newest = self._current_analysis, self.files.add(self.folder.commit(tap, codes, answered))
        self._current_analysis = self._make_analysis(analysis.measurements) if is_newest and analysis else None
        self._mark = self.folder.change_mark

    def replay(
        self,
        file: Path | str,
        date: datetime | None = None,
        tool: str = "",
        direction: str = "",
        conditions: Conditions = UNKNOWN_CONDITIONS,
        **description: Any,
    ) -> Measurement:
        """Store a recorded file as a tap test, unless it is stored already, and measure it.

        Parameters
        ----------
        file
            Path of the recorded file.
        date
            Time of recording. None if the file names it.
        tool
            Name of the tool. Default: from the file, else [tap] tool of machine.toml.
        direction
            Direction at the tool tip. Default: from the file, else "x".
        conditions
            Conditions of the tap test.
        description
            Other fields of `acquisition.Description`, such as ``unit="g/N"``.

        Returns
        -------
        Measurement
            Measurement of the stored tap test.

        Raises
        ------
        DataError
            If the file cannot be trusted or lacks information.
        """
        known = Description(date=date, tool=tool, direction=direction, conditions=conditions, **description)
        (tap_id,) = self.replay_all([Path(file)], known).tap_ids
        self.files.refuse_excluded(tap_id)
        return self.measurement(tap_id)

    def replay_all(self, files: Sequence[Path], description: Description, **options: Any) -> recordings.ReplayOutcome:
        """Store recorded files as tap tests, each once.

        Parameters
        ----------
        files
            Paths of the recorded files.
        description
            Facts that the files do not state.
        options
            `workers`, `keep_going` and `progress` of `store_recordings`.
        """
        with self.folder.locked():
            enter_orphaned_taps(self.folder)  # else an interrupted replay would be stored twice
            options["on_stored"] = self._remember_fit
            outcome = recordings.store_recordings(self.folder, files, description, **options)
            self._invalidate()
            known = dict.fromkeys(outcome.already_stored.values())
            decided = [tap_id for tap_id in known if self.decide_hits(tap_id, description.hit_decisions)]
        return replace(outcome, decided_tap_ids=decided)

    def _remember_fit(self, fit: TapFit, more: bool) -> None:
        """Remember the fit of a stored tap test. If more follow, now and then write the rows of the history."""
        self.fits[fit.tap_id], start = fit, time.monotonic()
        if more and start >= self._next_row_saving:
            self._invalidate()
            self.query(Analysis.save_rows)
            self._next_row_saving = start + (1 + ROW_SAVING_PAUSE) * (time.monotonic() - start)

    def accept(self, tap_ids: Sequence[str], codes: Sequence[str]) -> list[str]:
        """Accept questions on tap tests permanently.

        Parameters
        ----------
        tap_ids
            Identities of the tap tests.
        codes
            Codes of the questions.

        Returns
        -------
        list of str
            Codes that none of these tap tests raises.
        """
        unasked = accept_questions(self.folder, self.questions, tap_ids, codes) if codes else []
        if len(unasked) < len(codes):
            self._invalidate()
        return unasked

    def edit_modes(self, tap_ids: Sequence[str], edits: ModeEdits) -> dict[str, str]:
        """Store edits of the modes of tap tests permanently. Empty edits withdraw earlier ones.

        Parameters
        ----------
        tap_ids
            Identities of the tap tests.
        edits
            Modes to add, drop and hold.

        Returns
        -------
        dict
            Reason for each tap test that the edits do not fit; nothing is stored for it.
        """
        entries = {tap_id: self.files.by_id[tap_id] for tap_id in tap_ids}
        fits = {tap_id: fit_tap(self.folder.read(entry), self.machine, edits) for tap_id, entry in entries.items()}
        remarks = [(tap_id, remark) for tap_id, fit in fits.items() for remark in fit.remarks]
        reasons = {tap_id: remark.text for tap_id, remark in remarks if remark.code == EDITS_NOT_APPLIED_CODE}
        fits = {tap_id: fit for tap_id, fit in fits.items() if tap_id not in reasons}
        store_mode_edits(self.folder, [*fits], edits)
        self.fits |= fits
        self._invalidate()
        return reasons

    def decide_hits(self, tap_id: str, decisions: Sequence[HitDecision]) -> bool:
        """Store decisions on hits of a tap test permanently. The same decision again changes nothing.

        Parameters
        ----------
        tap_id
            Identity of the tap test.
        decisions
            Decisions, at most one per hit.

        Returns
        -------
        bool
            Whether anything was stored.

        Raises
        ------
        ValueError
            If a decision does not fit the hits, or no hit remains. Nothing is stored then.
        DataError
            If the file is damaged.
        """
        if not decisions:
            return False
        with self.folder.locked():
            self._invalidate()
            self.read_decided(tap_id, decisions)
            new = [made for made in decisions if made not in self.files.by_id[tap_id].hit_decisions]
            if new:
                store_hit_decisions(self.folder, tap_id, new)
                self.fits.pop(tap_id, None)
                self._invalidate()
        return bool(new)

    def read_decided(self, tap_id: str, decisions: Sequence[HitDecision]) -> TapTest:
        """Read a tap test with further decisions on its hits. Errors as `decide_hits`."""
        tap = self.folder.read(self.files.by_id[tap_id])
        return decide_hits(tap, add_decisions(tap.flags, tap.decisions, decisions))

    def _invalidate(self) -> None:
        """Forget everything after a change on the disk."""
        self.files.forget()
        self._current_analysis, self._mark = None, self.folder.change_mark

    def _make_analysis(self, measurements: TapMeasurements) -> Analysis:
        return Analysis(self.folder, self.files, self._cache, measurements, self._now)
