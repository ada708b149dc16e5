"""Cache of the history in history.rows."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from operator import is_

from acquisition import Remark
from acquisition.errors import format_error
from lobewatch.history.history import History, HistoryRow, decode_row, encode_row, keep_unusable_row, make_empty_history
from lobewatch.history.tap_measurements import NO_REUSABLE_ROWS, ReusableRows, UsableTaps, is_row_of
from lobewatch.machine import BusyError, Machine, MachineFolder
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.row_file import append_rows, read_rows, write_rows
from lobewatch.machine.settings.setting_questions import hash_programs
from lobewatch.measurement.software import ANALYSIS_REVISION
from lobewatch.tool.tap_series import TapPlace

MAX_OBSOLETE_BYTES = 1_000_000
"""Size of obsolete rows, besides that of the valid ones, above which the file is rewritten."""


class HistoryCache:
    """Cache file of one machine, read and appended to."""

    def __init__(self, folder: MachineFolder) -> None:
        self._folder = folder
        self._rows: list[HistoryRow] = []
        self._contents: list[bytes] = []
        self._aside: list[bytes] = []
        self._size = self._length = 0
        self._stamp: tuple[int, ...] | None = None
        self._fitting: tuple[Sequence[TapPlace], int] = (), 0
        self._hashes: dict[str, str] = {}
        self.other_rows: dict[str, HistoryRow] = {}
        """Rows of other settings or versions by tap test."""
        self.remarks: list[Remark] = []
        """Reasons why something was not written."""
        self.reusable = NO_REUSABLE_ROWS
        """Rows that were read behind those that `read` gave."""

    def read(self, files: UsableTaps) -> History:
        """Read the oldest rows that are valid for these settings and this version.

        Rows of tap tests with unusable files are kept aside.
        """
        empty, lost_ids = make_empty_history(self._folder.machine), {entry.id for entry in files.lost}
        hashes = _hash_programs(self._folder.machine, files.contents.cuts)
        if self._stamp is None or self._stamp != self._stamp_now or hashes != self._hashes:
            self._hashes = hashes
            self._read(_cache_header(empty))
        stored = {row.tap_id: row for row in self._rows} | self.other_rows if lost_ids else {}
        kept = tuple(keep_unusable_row(stored[tap_id], empty.software) for tap_id in stored if tap_id in lost_ids)
        valid = tuple(self._rows[: self._count_fitting(files.places)])
        changed = len(valid) < min(len(self._rows), len(files.places))
        self.reusable = ReusableRows(self._rows, files.by_id, files.contents.baselines) if changed else NO_REUSABLE_ROWS
        return replace(empty, baseline=files.baseline, rows=valid, kept=kept)

    def _count_fitting(self, places: Sequence[TapPlace]) -> int:
        """Count the rows that belong to these places; those compared before are not compared again."""
        compared, count = self._fitting
        count = min(count, len(self._rows)) if compared is places else 0
        for row, place in zip(self._rows[count:], places[count:], strict=False):
            if not is_row_of(row, place):
                break
            count += 1
        self._fitting = places, count
        return count

    def store(self, history: History) -> None:
        """Write new rows if the lock is free at once, else add a remark."""
        try:
            with self._folder.locked(patience=0):
                self._store(history)
        except (BusyError, OSError) as error:
            text = f"history computed in memory only, because the file was not updated: {format_error(error)}"
            remark = Remark("history-in-memory", self._folder.history_path.name, text)
            self.remarks += [] if remark in self.remarks else [remark]

    @property
    def _stamp_now(self) -> tuple[int, ...] | None:
        """Stamp of the file, which another program changes; None without a file."""
        try:
            status = self._folder.history_path.stat()
        except OSError:
            return None
        return status.st_size, status.st_mtime_ns, status.st_ino

    def _read(self, head: bytes) -> None:
        self._stamp, self._fitting = self._stamp_now, ((), 0)
        self._rows, self._contents, self._size, self._length = [], [], 0, 0
        self.other_rows, self._aside, hashes = {}, [], self._hashes
        try:
            stored = read_rows(self._folder.history_path)
            is_current = stored.rows[:1] == (head,)
            software = "" if is_current else b"".join(stored.rows[:1]).decode().partition(" ")[2]
            for content in stored.rows[1:]:
                number, row = decode_row(content, hashes, software)
                if number < 0 or not is_current:
                    self.other_rows[row.tap_id] = row
                    self._aside.append(content)
                else:
                    self._rows[number : number + 1] = [row]
                    self._contents[number : number + 1] = [content]
        except (ValueError, OSError):
            self._rows, self._contents, self.other_rows, self._aside = [], [], {}, []
        else:
            self._size, self._length = stored.sound_bytes if is_current else 0, stored.file_bytes

    def _store(self, history: History) -> None:
        path, hashes = self._folder.history_path, self._hashes or hash_programs(self._folder.machine)
        if self._stamp_now != self._stamp and self._stamp_now is not None:
            self._read(_cache_header(history))  # another program has written
        same = [*map(is_, history.rows, self._rows), False].index(False)
        self._fitting = self._fitting[0], min(self._fitting[1], same)
        later = [
            self._contents[n] if n < len(self._rows) and self._rows[n] is row else encode_row(n, row, hashes)
            for n, row in enumerate(history.rows[same:], same)
        ]
        contents = self._contents[:same] + later
        pairs = zip_longest(later, self._contents[same : len(contents)])
        fresh = [content for content, stored in pairs if content is not stored and content != stored]
        aside = [encode_row(-1, row, hashes) for row in history.kept]
        most = 2 * sum(map(len, contents)) + MAX_OBSOLETE_BYTES
        grows = contents[len(self._contents) - 1 :] and self._size + sum(map(len, fresh)) < most
        if self._size and aside == self._aside and path.exists() and grows:
            self._length = append_rows(path, self._size, fresh) if fresh else self._length
        else:
            self._length = write_rows(path, [_cache_header(history), *contents, *aside])
        self._aside = aside
        self._rows, self._contents, self._size = list(history.rows), contents, self._length
        self._stamp = self._stamp_now


def _hash_programs(machine: Machine, cuts: Sequence[CutEntry]) -> dict[str, str]:
    """Return the hash of all that decides the stored verdict on each program, test cuts of its tool included."""
    hashes = hash_programs(machine)
    for program in machine.program:
        taught = [f" {cut.id}" for cut in cuts if cut.is_evidence and cut.tool == program.tool]
        hashes[program.name] += "".join(taught)
    return hashes


def _cache_header(history: History) -> bytes:
    return f"{history.settings_hash}/{ANALYSIS_REVISION} {history.software}".encode()
