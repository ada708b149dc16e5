"""history.rows anew from the tap tests, with the word on every program after each of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from acquisition import DataError, read_tap
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine, ProgramTable, TapEntry
from lobewatch.machine.folder_contents import find_file_fault
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement.share_work import Workers, share_work
from lobewatch.measurement.tap_measurement import TapFit, fit_tap, is_fit_of
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.verdict import Stability, Verdict, evaluate_program

RebuildProgress = Callable[[int, int], None]
"""Told how many tap tests are done, and of how many."""


@dataclass(frozen=True)
class TapFileBytes:
    """One tap file; empty where it is damaged."""

    entry: TapEntry
    """Its line of the journal."""
    content: bytes
    """All of it."""
    machine_toml: str
    """The machine as it is now."""


@dataclass(frozen=True, eq=False)
class VerdictRequest:
    """What the word on each program was after a tap test."""

    tools: Mapping[str, Assembly | DataError]
    """Tools as they were known then, or why one was not, by name."""
    machine_toml: str
    """The machine as it is now."""


def rebuild_history(logbook: Logbook, workers: Workers, progress: RebuildProgress = lambda _done, _of: None) -> int:
    """Write it anew and say how many rows it has; equal bit by bit whoever works."""
    logbook.folder.history_path.unlink(missing_ok=True)
    toml = logbook.folder.toml_text
    if workers.use_other_processes:
        entries = [place.entry for place in logbook.files.places]
        contents = (_read_tap_bytes(logbook, entry, toml) for entry in entries)
        fits = share_work(fit_tap_bytes, contents, workers, _is_tap_fit)
        logbook.fits |= {entry.id: fit for entry, fit in zip(entries, fits, strict=True) if fit is not None}
    tap_ids = [row.tap_id for row in logbook.history.rows]
    for number, (tap_id, verdicts) in enumerate(_evaluate_all(logbook, tap_ids, toml, workers), 1):
        logbook.query(Analysis.stored_verdicts, tap_id, verdicts=verdicts)
        progress(number, len(tap_ids))
    return len(tap_ids)


def _evaluate_all(
    logbook: Logbook, tap_ids: list[str], toml: str, workers: Workers
) -> Iterator[tuple[str, dict[str, Verdict]]]:
    """The verdicts after each tap test, as far as others work them out."""
    if not workers.use_other_processes:
        yield from ((tap_id, {}) for tap_id in tap_ids)
        return
    questions = (_make_verdict_request(logbook, tap_id, toml) for tap_id in tap_ids)
    yield from zip(tap_ids, share_work(evaluate_programs, questions, workers, _are_verdicts), strict=True)


def _read_tap_bytes(logbook: Logbook, entry: TapEntry, toml: str) -> TapFileBytes:
    sound = not find_file_fault(logbook.folder.path, entry)
    return TapFileBytes(entry, (logbook.folder.path / entry.file).read_bytes() if sound else b"", toml)


def _make_verdict_request(logbook: Logbook, tap_id: str, toml: str) -> VerdictRequest:
    tools = dict.fromkeys(program.tool for program in logbook.machine.program)
    return VerdictRequest({tool: logbook.query(Analysis.assembly_or_reason, tool, tap_id) for tool in tools}, toml)


def fit_tap_bytes(tap: TapFileBytes) -> TapFit | None:
    """The modes in a tap file; None where it cannot be read."""
    with tempfile.TemporaryDirectory(prefix="lobewatch-") as work:
        path = Path(work) / "tap.h5"
        path.write_bytes(tap.content)
        try:
            return fit_tap(read_tap(path), _parse_cached(tap.machine_toml), tap.entry.by_hand)
        except DataError:
            return None


def evaluate_programs(question: VerdictRequest) -> dict[str, Verdict]:
    """On all programs, by their names."""
    machine = _parse_cached(question.machine_toml)
    return {table.name: evaluate_program(table, question.tools[table.tool], machine) for table in machine.program}


def _is_tap_fit(tap: TapFileBytes, answer: Any) -> bool:
    return answer is None or is_fit_of(answer, tap.entry)


def _are_verdicts(question: VerdictRequest, answer: Any) -> bool:
    programs = {table.name: table for table in _parse_cached(question.machine_toml).program}
    return answer.keys() == programs.keys() and all(_is_verdict(programs[name], answer[name]) for name in programs)


def _is_verdict(program: ProgramTable, answer: Any) -> bool:
    """An unknown limit is NaN, a known one is not."""
    known = answer.word is not Stability.UNKNOWN
    return (
        isinstance(answer, Verdict) and isinstance(answer.stability, Stability) and answer.program == program
    ) and known == (answer.limit > 0)


@lru_cache(maxsize=4)
def _parse_cached(toml: str) -> Machine:
    return parse_machine_file(toml)
