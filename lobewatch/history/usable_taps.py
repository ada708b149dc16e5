"""Usable tap tests of a machine; a test with a damaged file is left out from then on."""

from collections.abc import Sequence
from datetime import UTC, datetime

from acquisition import DataError, Remark
from lobewatch.machine import DamagedTapError, MachineFolder, TapEntry
from lobewatch.machine.folder import FolderContents
from lobewatch.machine.journal.alarm_entries import FleetScatter
from lobewatch.machine.journal.journal import format_command
from lobewatch.tool.tap_series import TapOrder, TapPlace

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
        for tap in self.excluded:
            if tap.id == tap_id:
                cure = f"{format_command('include', self._folder.path)} {tap_id} takes it back"
                raise DataError(f"{tap_id}: stored already, but excluded, for {tap.excluded!r}; {cure}")

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
        fitting = [tap for tap in current if tool in (None, tap.tool)]
        if fitting:
            return fitting[-1]
        tool_text = "" if tool is None else f" with tool {tool!r}"
        damaged = [str(remark) for remark in self.remarks]
        if damaged:
            raise NotTappedError(f"{self._folder.path}: no tap test{tool_text} that can be used: {'; '.join(damaged)}")
        cure = "take one with session.TapSession, or replay a recorded file"
        since = "yet" if self.baseline is None else f"since the new baseline of {self.baseline.astimezone():%Y-%m-%d}"
        if self.excluded:
            since += f", but {len(self.excluded)} excluded"
            cure += f"; {format_command('include', self._folder.path)} TAP takes one back"
        raise NotTappedError(f"{self._folder.path}: no tap test{tool_text} {since}; {cure}")

    def newest_damaged_remarks(self, tool: str = "") -> tuple[Remark, ...]:
        """Return remarks on damaged tap tests that are newer than all usable ones of their series."""
        if not self.lost:
            return ()
        usable = {(place.entry.tool, place.entry.direction): place.entry.created for place in self.places}
        since = self.baseline or EARLIEST_TIME
        lost = [entry for entry in self.lost if entry.created >= since and tool in ("", entry.tool)]
        newer = [entry for entry in lost if entry.created > usable.get((entry.tool, entry.direction), EARLIEST_TIME)]
        text = "newer than all of its tool and direction that can be used, but its file is damaged"
        return tuple(Remark("newest-damaged", f"tap test {entry.id}", text, "tap again") for entry in newer)

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
