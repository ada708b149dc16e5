"""Rebuild history.rows from the tap tests, with the verdict on every program after each test."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from acquisition import DataError
from acquisition.file_io import delete
from acquisition.hit_quality.decide_hits import decide_stored_hits
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recordings.recorded_files import parse_context, read_tap_bytes
from lobewatch.machine import ProgramTable, TapEntry
from lobewatch.machine.folder import find_file_fault
from lobewatch.measurement.share_work import Workers, share_work
from lobewatch.measurement.tap_measurement import TapFit, fit_tap, is_fit_of
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.verdict import Stability, Verdict, evaluate_program

RebuildProgress = Callable[[int, int], None]
"""Callback for progress: number of finished tap tests, and of all."""


class TapFileBytes(NamedTuple):
    """Content of one tap file, for a worker."""

    entry: TapEntry
    """Journal entry."""
    content: bytes
    """Content. Empty if the file is damaged."""
    machine_toml: str
    """Content of machine.toml."""


class VerdictRequest(NamedTuple):
    """Request for the verdicts on all programs after one tap test, for a worker."""

    tools: Mapping[str, Assembly | DataError]
    """Assembly of each tool at that time, or the reason why there is none, by name."""
    machine_toml: str
    """Content of machine.toml."""


def rebuild_history(logbook: Logbook, workers: Workers, progress: RebuildProgress = lambda _done, _of: None) -> int:
    """Rebuild history.rows and return its number of rows. The result does not depend on the workers."""
    delete(logbook.folder.history_path, missing_ok=True)
    toml = logbook.folder.toml_text
    if workers.use_other_processes:
        entries = [place.entry for place in logbook.files.places]
        contents = (_read_tap_bytes(logbook, entry, toml) for entry in entries)
        fits = share_work(fit_tap_bytes, contents, workers, _is_tap_fit)
        logbook.fits |= {entry.id: fit for entry, fit in zip(entries, fits, strict=True) if fit is not None}
    tap_ids = [row.tap_id for row in logbook.history.rows]
    verdicts_of_all: Iterable[dict[str, Verdict]] = [{}] * len(tap_ids)
    if workers.use_other_processes:
        requests = (_make_verdict_request(logbook, tap_id, toml) for tap_id in tap_ids)
        verdicts_of_all = share_work(evaluate_programs, requests, workers, _are_verdicts)
    for number, (tap_id, verdicts) in enumerate(zip(tap_ids, verdicts_of_all, strict=True), 1):
        logbook.query(Analysis.stored_verdicts, tap_id, verdicts=verdicts)
        progress(number, len(tap_ids))
    return len(tap_ids)


def _read_tap_bytes(logbook: Logbook, entry: TapEntry, toml: str) -> TapFileBytes:
    sound = not find_file_fault(logbook.folder.path, entry)
    return TapFileBytes(entry, (logbook.folder.path / entry.file).read_bytes() if sound else b"", toml)


def _make_verdict_request(logbook: Logbook, tap_id: str, toml: str) -> VerdictRequest:
    tools = dict.fromkeys(program.tool for program in logbook.machine.program)
    return VerdictRequest({tool: logbook.query(Analysis.assembly_or_reason, tool, tap_id) for tool in tools}, toml)


def fit_tap_bytes(tap: TapFileBytes) -> TapFit | None:
    """Fit the modes of a tap file. None if it cannot be read."""
    try:
        decided = decide_stored_hits(read_tap_bytes(tap.content), tap.entry.hit_decisions)
        return fit_tap(decided, parse_context(tap.machine_toml).machine, tap.entry.by_hand)
    except ValueError:
        return None


def evaluate_programs(request: VerdictRequest) -> dict[str, Verdict]:
    """Evaluate all programs, by name."""
    machine = parse_context(request.machine_toml).machine
    return {table.name: evaluate_program(table, request.tools[table.tool], machine) for table in machine.program}


def _is_tap_fit(tap: TapFileBytes, answer: Any) -> bool:
    return answer is None or is_fit_of(answer, tap.entry)


def _are_verdicts(request: VerdictRequest, answer: Any) -> bool:
    programs = {table.name: table for table in parse_context(request.machine_toml).machine.program}
    return answer.keys() == programs.keys() and all(_is_verdict(programs[name], answer[name]) for name in programs)


def _is_verdict(program: ProgramTable, answer: Any) -> bool:
    """Check a verdict from a worker. Its limit is NaN if, and only if, the verdict is unknown."""
    is_known = answer.stability is not Stability.UNKNOWN
    is_typed = isinstance(answer, Verdict) and isinstance(answer.stability, Stability)
    return is_typed and answer.program == program and is_known == (answer.limit > 0)
