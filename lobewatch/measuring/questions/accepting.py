"""Answers to what is asked of tap tests."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from acquisition import Remark
from lobewatch.machine import MachineFolder
from lobewatch.measuring.questions.asked import checked_codes


def accept(
    folder: MachineFolder, asked: Mapping[str, Sequence[str]], tap_ids: Sequence[str], codes: Sequence[str]
) -> list[str]:
    """Write down each of these codes for each of these tap tests that asks it; the codes that none of them asks.

    asked: codes of the open questions by tap test. ValueError, and nothing is written, where a code is no question.
    """
    codes = checked_codes(codes)
    found = [(tap_id, code) for tap_id in tap_ids for code in codes if code in asked.get(tap_id, ())]
    for tap_id, code in found:
        folder.accept(tap_id, code)
    answered = {code for _, code in found}
    return [code for code in codes if code not in answered]


def not_asked(codes: Sequence[str], tap_ids: Sequence[str], asked: Mapping[str, Sequence[str]]) -> str:
    """That these codes are no open questions of these tap tests, and which there are; asked: as for `accept`."""
    open_ones = "; ".join(f"{tap_id}: {', '.join(found)}" for tap_id, found in asked.items())
    told = f"--accept {' '.join(codes)}: not asked of {', '.join(tap_ids)}, which is stored"
    return f"{told}; open questions: {open_ones or 'none'}"


def about_questions(tap_id: str, questions: Sequence[Remark], path: Path | str) -> Iterator[Remark]:
    """What is asked of a tap test, with the command that answers; path: of the folder."""
    file = Path(path) / "taps" / f"{tap_id}.h5"
    for asked in questions:
        answer = shlex.join(["lobewatch", "replay", str(path), str(file), "--accept", asked.code])
        text = f"{asked.text}; it sets no reference until you say that it is right: {answer}"
        cure = f"Tap again; if this test is right, say so: {answer}"
        yield Remark(asked.code, f"tap test {tap_id}", text, cure)
