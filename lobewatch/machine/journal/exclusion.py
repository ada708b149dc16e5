"""Tap tests and test cuts taken out and back, as lines of the journal; the newest line on one of them counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from acquisition import check_name
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.machine.journal.tap_entry import TapEntry

Excludable = TapEntry | HeardCut
"""Entry of the journal that can be taken out."""


def find_excludable(name: str, taps: Sequence[TapEntry], cuts: Sequence[HeardCut], folder: str) -> Excludable:
    """Test cut of this identity, or tap test with this identity, file, or part of an identity.

    ValueError where it is none, or several have it.
    """
    for cut in cuts:
        if cut.id == name:
            return cut
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    exact = [tap for tap in taps if tap.id == part]
    fitting = exact or [tap for tap in taps if part and part in tap.id]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise ValueError(
            f"{name}: part of {len(fitting)} tap tests ({fitting[0].id}, {fitting[1].id}, ...); give one whole"
        )
    raise ValueError(f"{name!r}: no such tap test in {folder}; lobewatch history {folder} lists all {len(taps)}")


def exclusion(entry: Excludable, reason: str, now: datetime) -> dict[str, Any]:
    """Line that takes one out; ValueError where it is out already, or there is no reason."""
    if entry.excluded:
        raise ValueError(f"{entry.id}: excluded already, for {entry.excluded!r}")
    if not reason.strip():
        raise ValueError(f"{entry.id}: no reason; say why it does not count with --reason")
    check_name(reason, "reason")
    return {"kind": "exclude", "tap": entry.id, "reason": reason, "time": now.isoformat()}


def inclusion(entry: Excludable, now: datetime) -> dict[str, Any]:
    """Line that takes one back; ValueError where it is not out."""
    if not entry.excluded:
        raise ValueError(f"{entry.id}: is not excluded; it counts already")
    return {"kind": "include", "tap": entry.id, "time": now.isoformat()}


def exclusion_reasons(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Reasons why tap tests and test cuts are out, by identity."""
    reasons: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            reasons[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            reasons.pop(line["tap"], None)
    return reasons
