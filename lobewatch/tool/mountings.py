"""Which series a tap test belongs to: those of one tool with one stick-out in one state."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime

from acquisition import UNSAID, Conditions, Remark
from lobewatch.machine import TapEntry

DIVIDING = {"stick_out_mm": ("stick-out", "{:g} mm"), "state": ("state", "{!r}")}
"""What divides, its name and how a value is told."""


@dataclass(frozen=True)
class _Series:
    first: TapEntry
    known: Conditions


class Mountings:
    """The series of tap tests that are shown in order of time; what nobody said divides none."""

    def __init__(self) -> None:
        """None yet."""
        self._series: dict[str, list[_Series]] = {}
        """By tool, the current one last."""
        self._drawbar: dict[str, float] = {}

    def place(self, tap: TapEntry) -> tuple[str, tuple[Remark, ...]]:
        """Identity of the first test of the series of a test, and what is to be said of it."""
        found = self._series.setdefault(tap.tool, [])
        if found and tap.conditions is UNSAID:
            return found[-1].first.id, ()
        said = [*self._about_drawbar(tap)]
        current = found[-1] if found else None
        mounted = tap.conditions.over(current.known) if current else tap.conditions
        mine = next((one for one in reversed(found) if _is_like(one.known, mounted)), None)
        if current is not None and mine is not current:
            said += [_about_change(current, mounted, mine)]
        if mine is not None:
            found.remove(mine)
            found.append(replace(mine, known=mounted))
        else:
            found.append(_Series(tap, mounted))
        return found[-1].first.id, tuple(said)

    def _about_drawbar(self, tap: TapEntry) -> Iterator[Remark]:
        now, before = tap.conditions.drawbar_kn, self._drawbar.get(tap.tool)
        if now is None:
            return
        self._drawbar[tap.tool] = now
        if before not in (None, now):
            text = f"drawbar force {now:g} kN, {before:g} kN before: f_n may have changed with it"
            yield Remark("drawbar-changed", tap.tool, text, "where it was not meant, have the drawbar looked at")


def _is_like(one: Conditions, other: Conditions) -> bool:
    """Whether they differ in nothing that is known of both and divides."""
    return not _differing(one, other)


def _differing(one: Conditions, other: Conditions) -> list[str]:
    mine, its = one.known, other.known
    return [name for name in DIVIDING if name in mine and name in its and mine[name] != its[name]]


def _about_change(before: _Series, now: Conditions, found: _Series | None) -> Remark:
    changed = {name: DIVIDING[name] for name in _differing(before.known, now)}
    told = ", ".join(
        f"{label} {value.format(getattr(now, name))} after {value.format(getattr(before.known, name))}"
        for name, (label, value) in changed.items()
    )
    if found is None:
        return Remark("new-series", before.first.tool, f"{told}: a new series, compared with no test before it")
    since = datetime.fromisoformat(found.first.time)
    return Remark("earlier-series", before.first.tool, f"{told}: compared with the series begun {since:%Y-%m-%d}")
