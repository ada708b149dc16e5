"""Tap tests taken out of the series and back, as lines of the journal; the newest line on a tap test counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from acquisition import check_name
from lobewatch.machine.archive.tap_entry import TapEntry


def named_tap(name: str, taps: Sequence[TapEntry], folder: str) -> TapEntry:
    """The one with this identity, file, or part of an identity; ValueError where it is none, or several have it."""
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    exact = [tap for tap in taps if tap.id == part]
    found = exact or [tap for tap in taps if part and part in tap.id]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"{name}: part of {len(found)} tap tests ({found[0].id}, {found[1].id}, ...); give one whole")
    raise ValueError(f"{name!r}: no such tap test in {folder}; lobewatch history {folder} lists all {len(taps)}")


def exclusion(tap: TapEntry, reason: str, now: datetime) -> dict[str, Any]:
    """The line that takes a tap test out; ValueError where it is out already, or there is no reason."""
    if tap.excluded:
        raise ValueError(f"{tap.id}: excluded already, for {tap.excluded!r}")
    if not reason.strip():
        raise ValueError(f"{tap.id}: no reason; say why it does not count with --reason")
    check_name(reason, "reason")
    return {"kind": "exclude", "tap": tap.id, "reason": reason, "time": now.isoformat()}


def inclusion(tap: TapEntry, now: datetime) -> dict[str, Any]:
    """The line that takes a tap test back; ValueError where it is not out."""
    if not tap.excluded:
        raise ValueError(f"{tap.id}: is not excluded; it counts already")
    return {"kind": "include", "tap": tap.id, "time": now.isoformat()}


def reasons_of(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Why tap tests are out, by identity."""
    found: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            found[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            found.pop(line["tap"], None)
    return found
