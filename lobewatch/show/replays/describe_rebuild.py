"""What a rebuild has made of machines, as JSON and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from acquisition import Remark
from lobewatch.show.terminal.output import remark_json, remark_lines


class MachineRebuild(NamedTuple):
    """Outcome of a rebuild of one machine."""

    repairs: Sequence[str]
    """Sentences on the files that were mended, a line each."""
    n_taps: int
    """Number of tap tests in the new history."""
    is_saved: bool
    """Whether the new history is on the disk."""
    remarks: Sequence[Remark]
    """Remarks on the machine after it."""


def rebuild_json(rebuild: MachineRebuild) -> dict[str, Any]:
    """One machine."""
    remarks = [remark_json(remark) for remark in rebuild.remarks]
    return {"done": rebuild.repairs, "tap_tests": rebuild.n_taps, "remarks": remarks}


def rebuild_texts(rebuild: MachineRebuild) -> list[str]:
    """One machine for people."""
    if rebuild.is_saved:
        history = f"history.rows: made anew from {rebuild.n_taps} tap test(s)"
    else:
        history = "history.rows: not made anew (see above); the next command that can write makes it"
    return [*rebuild.repairs, *remark_lines(rebuild.remarks), history]


def folder_rebuild_json(rebuilds: Mapping[str, MachineRebuild]) -> dict[str, Any]:
    """The machines of a folder, by name."""
    return {"machines": {name: rebuild_json(rebuild) for name, rebuild in rebuilds.items()}}


def folder_rebuild_texts(rebuilds: Mapping[str, MachineRebuild], n_machines: int) -> list[str]:
    """The machines of a folder for people; n_machines: those that could not be rebuilt too."""
    lines = [f"{name}: {text}" for name, rebuild in rebuilds.items() for text in rebuild_texts(rebuild)]
    return [*lines, f"{len(rebuilds)} of {n_machines} machines rebuilt"]
