"""The diagrams of a row of the history: worked out where they are asked for, not stored."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from lobes import StabilityLobes
from lobewatch.history.history import Row, Values
from lobewatch.machine import Machine
from lobewatch.tool.assembly import tip_lobes
from modal import Mode


def row_lobes(row: Row, machine: Machine, names: Collection[str] | None = None) -> dict[str, StabilityLobes]:
    """As `lobes_of` of the assembly as it was then; names: of these cuts alone."""
    return tip_lobes(row.tool, _modes(row.x), _modes(row.y), machine, names)


def _modes(values: Sequence[Values]) -> list[Mode]:
    return [Mode(frequency, damping, stiffness, phase_deg=phase) for frequency, damping, stiffness, phase in values]
