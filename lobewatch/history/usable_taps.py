"""The tap tests of a machine that can be used; one whose file turns out to be damaged is left out from then on."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

from acquisition import DataError, Remark
from lobewatch.machine import DamagedTapError, MachineFolder, TapEntry
from lobewatch.machine.folder_contents import FolderContents
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.machine.journal.entries import Acknowledgement, FleetScatter, MaintenanceEvent
from lobewatch.machine.journal.journal import format_command
from lobewatch.tool.tap_series import TapOrder, TapPlace

EARLIEST_TIME = datetime.min.replace(tzinfo=UTC)


class NotTappedError(DataError):
    """A tool was neither tapped nor can it be predicted."""


class UsableTaps:
    """What the folder holds, looked at once."""

    def __init__(self, folder: MachineFolder) -> None:
        """Nothing is read yet."""
        self._folder = folder
        self._contents: FolderContents | None = None
        self._order: TapOrder | None = None
        self._left_out: dict[str, tuple[TapEntry, Remark]] = {}

    @property
    def places(self) -> Sequence[TapPlace]:
        """Those that can be used, oldest first by their time; a newer one is added to the same sequence."""
        if self._order is None:
            self._order = TapOrder(self._all.baselines)
            for tap in self._all.taps:
                if tap.id not in self._left_out and not tap.excluded:
                    self._order.add(tap)
        return self._order.places

    def place(self, tap_id: str) -> TapPlace:
        """Of one of them; KeyError where it is none."""
        for place in reversed(self.places):
            if place.entry.id == tap_id:
                return place
        raise KeyError(tap_id)

    def refuse_excluded(self, tap_id: str) -> None:
        """DataError for one that a person has taken out."""
        for tap in self.excluded:
            if tap.id == tap_id:
                cure = f"{format_command('include', self._folder.path)} {tap_id} takes it back"
                raise DataError(f"{tap_id}: stored already, but excluded, for {tap.excluded!r}; {cure}")

    def list_until(self, tap_id: str | None) -> list[TapPlace]:
        """Those up to one of them, since the baseline that counted then; None: up to now."""
        last = None if tap_id is None else self.place(tap_id)
        baseline = self.baseline if last is None else last.baseline
        places = self.places if last is None else self.places[: last.number + 1]
        return [place for place in places if place.baseline == baseline]

    def list_series(self, tap_id: str) -> list[TapEntry]:
        """Those that are compared with one of them; none with what is none of them, a prediction."""
        series = {place.entry.id: place.series for place in self.places}
        return [place.entry for place in self.places if place.series == series.get(tap_id)]

    @property
    def remarks(self) -> list[Remark]:
        """What is wrong with the files, as far as it is known by now."""
        of_files = () if self._contents is None else self._contents.remarks
        return [*of_files, *(remark for _, remark in self._left_out.values())]

    @property
    def events(self) -> Sequence[MaintenanceEvent]:
        """What was done to the machine, oldest first."""
        return self._all.events

    @property
    def cuts(self) -> Sequence[CutEntry]:
        """Test cuts, oldest first, those that a person has taken out too."""
        return self._all.cuts

    @property
    def acknowledgements(self) -> Sequence[Acknowledgement]:
        """What a person has acknowledged, oldest first."""
        return self._all.acknowledgements

    @property
    def fleet_scatter(self) -> FleetScatter | None:
        """What the other machines told first since the baseline of its scatter; None where they have told nothing."""
        since = (told for told in self._all.fleet_scatters if self.baseline is None or told.time >= self.baseline)
        return next(since, None)

    @property
    def excluded(self) -> Sequence[TapEntry]:
        """Those that a person has taken out, oldest first."""
        return [tap for tap in self._all.taps if tap.excluded]

    @property
    def lost(self) -> Sequence[TapEntry]:
        """Those whose files cannot be used, but for those that a person has taken out."""
        lost = [*self._all.lost, *(entry for entry, _ in self._left_out.values())]
        return [entry for entry in lost if not entry.excluded]

    @property
    def by_id(self) -> dict[str, TapEntry]:
        """All of the journal, whatever became of them."""
        return {entry.id: entry for entry in (*self._all.taps, *self._all.lost)}

    @property
    def baselines(self) -> list[datetime]:
        """The events from which on all comparing begins anew, oldest first."""
        return self._all.baselines

    @property
    def baseline(self) -> datetime | None:
        """The newest event from which on all comparing begins anew."""
        return max(self._all.baselines, default=None)

    def newest(self, tool: str | None) -> TapEntry:
        """The newest one since the baseline, of a tool where one is named; NotTappedError where there is none."""
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
        """Damaged ones (of a tool; "": of any) that are newer than all of their series that can be used."""
        if not self.lost:
            return ()
        newest_usable = {_series_key(place.entry): _entry_time(place.entry) for place in self.places}
        lost = [entry for entry in self.lost if _entry_time(entry) >= (self.baseline or EARLIEST_TIME)]
        newer = [
            entry
            for entry in lost
            if tool in ("", entry.tool) and _entry_time(entry) > newest_usable.get(_series_key(entry), EARLIEST_TIME)
        ]
        text = "newer than all of its tool and direction that can be used, but its file is damaged"
        return tuple(Remark("newest-damaged", f"tap test {entry.id}", text, "tap again") for entry in newer)

    def add(self, entry: TapEntry) -> bool:
        """A tap test that was just committed: whether it is newer than all, and all others are as they were.

        Where anybody else has written since, all is looked at again.
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
        """Look again."""
        self._contents = self._order = None

    def leave_out(self, error: DamagedTapError) -> None:
        """Go on without a tap test whose file is damaged; the error again where it was left out before."""
        if error.entry.id in self._left_out:
            raise error
        self._left_out[error.entry.id] = error.entry, error.remark
        self._order = None

    @property
    def _all(self) -> FolderContents:
        if self._contents is None:
            self._contents = self._folder.contents()
        return self._contents


def _series_key(entry: TapEntry) -> tuple[str, str]:
    return entry.tool, entry.direction


def _entry_time(entry: TapEntry) -> datetime:
    return datetime.fromisoformat(entry.time)
