"""Unequal pitches for a cut that is asked about, from the newest tap tests of its tool."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from lobes.floquet.program_limit import DEEPEST
from lobewatch.cuts.learning.at_speed import spindle_at_speed
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.settings.asked_cut import asked_program
from lobewatch.machine.settings.cut_range import MM
from lobewatch.verdicts.pitch_proposal import PitchProposal, propose_pitch


def asked_pitch(logbook: Logbook, said: Mapping[str, Any]) -> PitchProposal:
    """Pitches for the cut that is said (see `asked_program`), as deep as the tool cuts where no depth is.

    ValueError for what is no cut, DataError where its tool is not known.
    """
    machine, is_deep = logbook.machine, said.get("depth_mm") is None
    table = asked_program(machine, {**said, "depth_mm": MM} if is_deep else said)
    if is_deep:
        name = f"{table.speed_rpm:g} rpm"
        table = msgspec.structs.replace(table, name=name, depth_mm=table.deepest_mm / DEEPEST)
    assembly = logbook.assembly(table.tool)
    return propose_pitch(table, assembly, machine, spindle_at_speed(table, assembly, machine, logbook.cuts))
