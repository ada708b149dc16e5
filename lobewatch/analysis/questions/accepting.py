"""Answers to what is asked of tap tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lobewatch.analysis.questions.asked import checked_codes
from lobewatch.machine import MachineFolder


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
