"""Remarks as JSON and as lines."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition import Remark, joined


def remark_json(remark: Remark) -> dict[str, str]:
    """One remark."""
    return {"code": remark.code, "about": remark.about, "text": remark.text, "cure": remark.cure}


def remark_lines(remarks: Sequence[Remark]) -> list[str]:
    """A line each; those that say the same of several things once."""
    return [f"note: {remark}" for remark in joined(remarks)]
