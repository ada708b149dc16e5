"""What a replay would make of recorded files, as JSON and as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import Fact
from lobewatch.logbook.preview import Preview
from lobewatch.measuring.questions import open_questions
from lobewatch.show.spindle.describe_modes import in_order, mode_json
from lobewatch.show.terminal.output import emit, table

ONE_BY_ONE = 6
"""So many files are told in full, more of them in a line each."""
_ORIGINS = {"file": "from the file", "option": "by option", "default": "nobody says, taken"}


def show_preview(previews: Sequence[Preview], passed: Sequence[Path], *, as_json: bool) -> None:
    """Print what would become of files; passed: other files of the folders."""
    files = [preview_json(preview) for preview in previews]
    payload = {"dry_run": True, "files": files, "passed_over": list(map(str, passed))}
    emit(payload, as_json, *preview_texts(previews), preview_summary(previews, len(passed)))


def fact_lines(facts: Iterable[Fact]) -> list[str]:
    """What is known, a line for each place that it is from."""
    told = {origin: [f"{one.name} {one.value}" for one in facts if one.origin == origin] for origin in _ORIGINS}
    return [f"{_ORIGINS[origin]}: {'; '.join(texts)}" for origin, texts in told.items() if texts]


def preview_json(one: Preview) -> dict[str, Any]:
    """One file."""
    found, tap, recording = one.measurement, one.tap, one.recording
    told: dict[str, Any] = {"file": str(one.file), "known": one.known, "refused": one.refused}
    if found is None or tap is None or recording is None:
        return told
    return told | {
        "format": recording.title,
        "facts": [{"name": fact.name, "value": fact.value, "origin": fact.origin} for fact in recording.facts],
        "time": found.time.isoformat(),
        "tool": found.tool,
        "direction": found.direction,
        "hits": [flags.words for flags in tap.flags],
        "lines": tap.frf.frequency.size,
        "averages": tap.frf.n_averages,
        "modes": [mode_json(mode) for mode in found.modes],
        "followed": mode_json(found.followed) if found.followed else None,
        "questions": [{"code": asked.code, "text": asked.text} for asked in open_questions(found.remarks)],
    }


def preview_texts(previews: Sequence[Preview]) -> list[str | Table]:
    """All files: in full where there are few, else in a line each, with what is asked and refused below."""
    if len(previews) <= ONE_BY_ONE:
        return [line for one in previews for line in _in_full(one)]
    rows = table("<date", "<series", "hits", "f_n (Hz)", "<", "~file")
    for one in previews:
        rows.add_row(*_row(one))
    return [rows, *_below(previews)]


def preview_summary(previews: Sequence[Preview], n_passed: int) -> str:
    """How many would be stored, are known, refused and passed over."""
    fresh = sum(one.tap is not None for one in previews)
    known, refused = sum(bool(one.known) for one in previews), sum(bool(one.refused) for one in previews)
    passed = f", {n_passed} other files in the folders passed over" if n_passed else ""
    count = f"{fresh} of {len(previews)} file(s) would be stored, {known} stored already, {refused} cannot be used"
    return f"{count}{passed}; nothing is stored (--dry-run)"


def _in_full(one: Preview) -> list[str]:
    if one.known:
        return [f"{one.file}: stored already as {one.known}"]
    found, tap, recording = one.measurement, one.tap, one.recording
    if found is None or tap is None or recording is None:
        return [f"{one.file}: cannot be used: {one.refused}"]
    lines = [
        f"{one.file}: {recording.title}, {_hits_text(one)}",
        *(f"  {line}" for line in fact_lines(recording.facts)),
    ]
    modes = in_order(found.modes, rejected=False)[:8]
    each = (
        f"{mode.frequency:.4g} Hz ({100 * mode.damping_ratio:.3g} %, {mode.stiffness / 1e6:.3g} N/um)" for mode in modes
    )
    lines.append(f"  modes: {', '.join(each) or 'none'}")
    lines.append(f"  followed: {'none' if found.followed is None else f'{found.followed.frequency:.2f} Hz'}")
    asked = open_questions(found.remarks)
    plausible = "  plausible for this machine: nothing would be asked"
    return [
        *lines,
        *(f"  question ({question.code}): {question.text}" for question in asked),
        *([] if asked else [plausible]),
    ]


def _hits_text(one: Preview) -> str:
    """Hits with their verdicts."""
    if one.tap is None or not one.tap.hits:
        return "an FRF"
    words = Counter(flags.words for flags in one.tap.flags)
    return f"{len(one.tap.hits)} hit(s): " + ", ".join(f"{count} {word}" for word, count in words.items())


def _row(one: Preview) -> list[str]:
    found, tap = one.measurement, one.tap
    if found is None or tap is None:
        return ["", "", "", "", "stored already" if one.known else "refused", one.file.name]
    asked = open_questions(found.remarks)
    good = f"{len(tap.accepted)}/{len(tap.hits)}" if tap.hits else "FRF"
    frequency = "" if found.followed is None else f"{found.followed.frequency:.2f}"
    series = f"{found.tool} {found.direction}"
    return [f"{found.time:%Y-%m-%d}", series, good, frequency, "asked about" if asked else "plausible", one.file.name]


def _below(previews: Sequence[Preview]) -> list[str]:
    """What was taken for want of a word, asked and refused; each once."""
    facts = [fact for one in previews if one.recording for fact in one.recording.facts if fact.origin != "file"]
    lines = fact_lines(dict.fromkeys(facts))
    for one in previews:
        asked = open_questions(one.measurement.remarks) if one.measurement else ()
        lines += [f"{one.file.name}: question ({question.code}): {question.text}" for question in asked]
        lines += [f"{one.file}: cannot be used: {one.refused}"] if one.refused else []
    return lines
