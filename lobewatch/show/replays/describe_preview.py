"""What a replay would make of recorded files, as JSON and as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import DataError, Fact
from acquisition.files.contents.ledger import Origin
from dsm import rounded
from lobewatch.logbook.preview import Preview
from lobewatch.logbook.replaying.of_files import NAMED, of_files
from lobewatch.measuring.questions import open_questions
from lobewatch.show.spindle.describe_modes import NOT_IN_FILE, fact_lines, in_order, mode_json
from lobewatch.show.terminal.output import emit, table
from modal import Mode

ONE_BY_ONE = 6
"""Files that are told in full at most; more of them get a line each."""


def show_preview(previews: Sequence[Preview], passed: Sequence[Path], *, as_json: bool) -> None:
    """Print what would become of files; passed: other files of the folders. DataError where some cannot be used."""
    files = [preview_json(preview) for preview in previews]
    payload = {"dry_run": True, "files": files, "passed_over": list(map(str, passed))}
    emit(payload, as_json, *preview_texts(previews), preview_summary(previews, len(passed)))
    if any(preview.refused for preview in previews):
        raise DataError(_refusal(previews))


def preview_json(preview: Preview) -> dict[str, Any]:
    """One file."""
    measurement, tap, recording = preview.measurement, preview.tap, preview.recording
    about: dict[str, Any] = {"file": str(preview.file), "known": preview.known, "refused": preview.refused}
    if measurement is None or tap is None or recording is None:
        return about
    return about | {
        "format": recording.title,
        "facts": [{"name": fact.name, "value": fact.value, "origin": fact.origin} for fact in recording.facts],
        "time": measurement.time.isoformat(),
        "tool": measurement.tool,
        "direction": measurement.direction,
        "hits": [flags.words for flags in tap.flags],
        "lines": tap.frf.frequency.size if tap.frf else None,
        "averages": tap.frf.n_averages if tap.frf else None,
        "modes": [mode_json(mode) for mode in measurement.modes],
        "followed": mode_json(measurement.followed) if measurement.followed else None,
        "questions": [{"code": asked.code, "text": asked.text} for asked in open_questions(measurement.remarks)],
    }


def preview_texts(previews: Sequence[Preview]) -> list[str | Table]:
    """All files: in full where there are few, else in a line each, with what is asked and refused below."""
    if len(previews) <= ONE_BY_ONE:
        return [
            *(line for preview in previews if not preview.refused for line in _in_full(preview)),
            *_refused(previews),
        ]
    rows = table("<date", "<series", "hits", "frequency (Hz)", "<", "~file")
    for preview in previews:
        rows.add_row(*_row(preview))
    return [rows, *_below(previews)]


def preview_summary(previews: Sequence[Preview], n_passed: int) -> str:
    """How many would be stored, are known, refused and passed over."""
    fresh = sum(preview.tap is not None for preview in previews)
    n_known = sum(bool(preview.known) for preview in previews)
    refused = sum(bool(preview.refused) for preview in previews)
    passed = f", {n_passed} other files in the folders passed over" if n_passed else ""
    count = f"{fresh} of {len(previews)} file(s) would be stored, {n_known} stored already, {refused} cannot be used"
    return f"{count}{passed}; nothing is stored (--dry-run)"


def _refusal(previews: Sequence[Preview]) -> str:
    """How many files cannot be used."""
    refused = sum(bool(preview.refused) for preview in previews)
    return f"{refused} of {len(previews)} file(s) cannot be used as they are; the reasons stand above"


def _in_full(preview: Preview) -> list[str]:
    if preview.known:
        return [f"{preview.file}: stored already as {preview.known}"]
    measurement, tap, recording = preview.measurement, preview.tap, preview.recording
    if measurement is None or tap is None or recording is None:
        return []
    lines = [
        f"{preview.file}: {recording.title}, {_hits_text(preview)}",
        *(f"  {line}" for line in fact_lines(recording.facts)),
    ]
    modes = in_order(measurement.modes, rejected=False)[:8]
    lines.append(f"  modes: {', '.join(map(_mode_text, modes)) or 'none'}")
    followed = "none" if measurement.followed is None else f"{measurement.followed.frequency:.2f} Hz"
    lines.append(f"  followed: {followed}")
    asked = open_questions(measurement.remarks)
    plausible = "  plausible for this machine: nothing would be asked"
    return [
        *lines,
        *(f"  question ({question.code}): {question.text}" for question in asked),
        *([] if asked else [plausible]),
    ]


def _mode_text(mode: Mode) -> str:
    f_std, zeta_std, k_std = mode.standard_error.tolist()
    stiffness = f", {rounded(mode.stiffness, k_std, 1e6)} N/um" if mode.has_stiffness else ""
    return f"{rounded(mode.frequency, f_std)} Hz ({rounded(mode.damping_ratio, zeta_std, 0.01)} %{stiffness})"


def _hits_text(preview: Preview) -> str:
    """Hits with their verdicts."""
    if preview.tap is None or not preview.tap.hits:
        return "an FRF"
    words = Counter(flags.words for flags in preview.tap.flags)
    return f"{len(preview.tap.hits)} hit(s): " + ", ".join(f"{count} {word}" for word, count in words.items())


def _row(preview: Preview) -> list[str]:
    measurement, tap = preview.measurement, preview.tap
    if measurement is None or tap is None:
        return ["", "", "", "", "stored already" if preview.known else "refused", preview.file.name]
    asked = open_questions(measurement.remarks)
    good = f"{len(tap.accepted)}/{len(tap.hits)}" if tap.hits else "FRF"
    frequency = "" if measurement.followed is None else f"{measurement.followed.frequency:.2f}"
    series, day = f"{measurement.tool} {measurement.direction}", f"{measurement.time:%Y-%m-%d}"
    return [day, series, good, frequency, "asked about" if asked else "plausible", preview.file.name]


def _below(previews: Sequence[Preview]) -> list[str]:
    """Lines on what was taken for want of a word, asked and refused; each once."""
    facts = dict.fromkeys(fact for preview in previews if preview.recording for fact in preview.recording.facts)
    asked = (
        (preview.file.name, f"question ({question.code}): {question.text}")
        for preview in previews
        if preview.measurement is not None
        for question in open_questions(preview.measurement.remarks)
    )
    return [*fact_lines(_ranges(facts), NOT_IN_FILE), *of_files(asked), *_refused(previews)]


def _refused(previews: Sequence[Preview]) -> list[str]:
    return of_files(
        (str(preview.file), f"cannot be used: {preview.refused}") for preview in previews if preview.refused
    )


def _ranges(facts: Iterable[Fact]) -> Iterator[Fact]:
    """Facts, those that are another for each of many files as the first and the last."""
    values: dict[tuple[str, Origin], list[str]] = {}
    for fact in facts:
        values.setdefault((fact.name, fact.origin), []).append(fact.value)
    for (name, origin), texts in values.items():
        shown = texts if len(texts) <= NAMED else [f"{texts[0]} to {texts[-1]}"]
        yield from (Fact(name, text, origin) for text in shown)
