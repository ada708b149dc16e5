"""Which series a tap test belongs to: those of one tool with one stick-out in one state."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime

from acquisition import UNSAID, Conditions, Remark
from lobewatch.machine import TapEntry

DIVIDING = {"stick_out_mm": ("stick-out", "{:g} mm"), "state": ("state", "{!r}")}
"""Conditions that divide series, each with its name and how a value is told."""


@dataclass(frozen=True)
class MountedTool:
    """A tool as it is mounted in one series."""

    first: TapEntry
    """First tap test of the series."""
    conditions: Conditions
    """Conditions that were stated of it so far."""


class MountedTools:
    """The series of tap tests that are shown in order of time; what nobody said divides none."""

    def __init__(self) -> None:
        """None yet."""
        self._mountings: dict[str, list[MountedTool]] = {}
        """By tool, the current one last."""
        self._drawbar: dict[str, float] = {}
        self._hours: float | None = None

    def place(self, tap: TapEntry) -> tuple[str, tuple[Remark, ...]]:
        """Identity of the first test of the series of a test, and what is to be said of it."""
        mountings = self._mountings.setdefault(tap.tool, [])
        if mountings and tap.conditions is UNSAID:
            return mountings[-1].first.id, ()
        remarks = [*self._about_drawbar(tap), *self._about_hours(tap)]
        current = mountings[-1] if mountings else None
        conditions = tap.conditions.over(current.conditions) if current else tap.conditions
        fitting = next(
            (mounting for mounting in reversed(mountings) if _is_like(mounting.conditions, conditions)), None
        )
        if current is not None and fitting is not current:
            remarks += [_about_change(current, conditions, fitting)]
        if fitting is not None:
            mountings.remove(fitting)
            mountings.append(replace(fitting, conditions=conditions))
        else:
            mountings.append(MountedTool(tap, conditions))
        return mountings[-1].first.id, tuple(remarks)

    def _about_drawbar(self, tap: TapEntry) -> Iterator[Remark]:
        now, before = tap.conditions.drawbar_kn, self._drawbar.get(tap.tool)
        if now is None:
            return
        self._drawbar[tap.tool] = now
        if before not in (None, now):
            text = f"drawbar force {now:g} kN, {before:g} kN before: the frequency may have changed with it"
            yield Remark("drawbar-changed", tap.tool, text, "where it was not meant, have the drawbar looked at")

    def _about_hours(self, tap: TapEntry) -> Iterator[Remark]:
        now, before = tap.conditions.hours, self._hours
        if now is None:
            return
        self._hours = now
        if before is not None and now < before:
            text = f"running hours {now:g} h, {before:g} h before: forecasts of a series that it is in count in days"
            yield Remark("hours-went-back", tap.tool, text, "exclude it and replay its file with the right --hours")


def _is_like(first: Conditions, second: Conditions) -> bool:
    """Whether they differ in nothing that is stated of both and divides."""
    return not _differing(first, second)


def _differing(first: Conditions, second: Conditions) -> list[str]:
    stated, also_stated = first.known, second.known
    return [name for name in DIVIDING if name in stated and name in also_stated and stated[name] != also_stated[name]]


def _about_change(before: MountedTool, now: Conditions, earlier: MountedTool | None) -> Remark:
    """Remark on a tool that is mounted otherwise than before; earlier: its series, where it was mounted so once."""
    changed = {name: DIVIDING[name] for name in _differing(before.conditions, now)}
    change = ", ".join(
        f"{label} {value.format(getattr(now, name))} after {value.format(getattr(before.conditions, name))}"
        for name, (label, value) in changed.items()
    )
    if earlier is None:
        return Remark("new-series", before.first.tool, f"{change}: a new series, compared with no test before it")
    since = datetime.fromisoformat(earlier.first.time)
    return Remark("earlier-series", before.first.tool, f"{change}: compared with the series begun {since:%Y-%m-%d}")
