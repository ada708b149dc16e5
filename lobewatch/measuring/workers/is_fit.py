"""Whether what a worker answers can be the fit of a tap test."""

from __future__ import annotations

from dataclasses import replace

from acquisition import Remark
from lobewatch.machine import TapEntry
from lobewatch.measuring.measurement import TapFit
from modal import Mode


def is_fit(answer: object, entry: TapEntry) -> bool:
    """Whether it is one of this tap test with modes that may be. A wrong value that could be right is not seen."""
    return (
        isinstance(answer, TapFit)
        and (answer.tap_id, answer.time.isoformat()) == (entry.id, entry.time)
        and (answer.tool, answer.direction) == (entry.tool, entry.direction)
        and isinstance(answer.failed, bool)
        and all(isinstance(remark, Remark) for remark in answer.remarks)
        and all(isinstance(mode, Mode) and _may_be(mode) for mode in answer.modes)
    )


def _may_be(mode: Mode) -> bool:
    try:
        replace(mode)  # what has come from elsewhere was never checked
    except (TypeError, ValueError):
        return False
    return True
