"""Tap tests and test cuts taken out and back, as lines of the journal; the newest line on one of them counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from acquisition import check_name
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.machine.journal.tap_entry import TapEntry

Corrected = TapEntry | HeardCut
"""What can be taken out."""


def named(name: str, taps: Sequence[TapEntry], cuts: Sequence[HeardCut], folder: str) -> Corrected:
    """The test cut of this identity, or the tap test with this identity, file, or part of an identity.

    ValueError where it is none, or several have it.
    """
    for cut in cuts:
        if cut.id == name:
            return cut
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    exact = [tap for tap in taps if tap.id == part]
    found = exact or [tap for tap in taps if part and part in tap.id]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"{name}: part of {len(found)} tap tests ({found[0].id}, {found[1].id}, ...); give one whole")
    raise ValueError(f"{name!r}: no such tap test in {folder}; lobewatch history {folder} lists all {len(taps)}")


def exclusion(tap: Corrected, reason: str, now: datetime) -> dict[str, Any]:
    """The line that takes one out; ValueError where it is out already, or there is no reason."""
    if tap.excluded:
        raise ValueError(f"{tap.id}: excluded already, for {tap.excluded!r}")
    if not reason.strip():
        raise ValueError(f"{tap.id}: no reason; say why it does not count with --reason")
    check_name(reason, "reason")
    return {"kind": "exclude", "tap": tap.id, "reason": reason, "time": now.isoformat()}


def inclusion(tap: Corrected, now: datetime) -> dict[str, Any]:
    """The line that takes one back; ValueError where it is not out."""
    if not tap.excluded:
        raise ValueError(f"{tap.id}: is not excluded; it counts already")
    return {"kind": "include", "tap": tap.id, "time": now.isoformat()}


def reasons_of(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Why tap tests and test cuts are out, by identity."""
    found: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            found[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            found.pop(line["tap"], None)
    return found
