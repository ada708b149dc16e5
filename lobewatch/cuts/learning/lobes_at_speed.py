"""The stability lobes of a cut with the spindle at speed, as test cuts have taught it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from lobes import StabilityLobes
from lobewatch.machine import Machine
from lobewatch.tool.assembly import tip_lobes
from lobewatch.verdicts.limit_band import LimitBand, limit_band
from lobewatch.verdicts.verdict import Verdict


class LobesAtSpeed(NamedTuple):
    """By zero order."""

    cuts: int
    """Test cuts that they were learnt from."""
    lobes: StabilityLobes
    """In the middle of what was learnt."""
    band: LimitBand
    """What the cuts have left open."""


def lobes_at_speed(verdicts: Sequence[Verdict], machine: Machine) -> LobesAtSpeed | None:
    """Of programs with the same cut, from their verdicts; None where no test cut has taught anything."""
    for verdict in verdicts:
        tool, name, at_speed = verdict.assembly, verdict.program.name, verdict.at_speed
        if tool is None or not at_speed.cuts:
            continue
        taught, spindle = msgspec.structs.replace(machine, program=(verdict.program,)), at_speed.moved(tool)
        lobes = tip_lobes(spindle.tool, spindle.x, spindle.y, taught, [name])[name]
        return LobesAtSpeed(at_speed.cuts, lobes, limit_band(lobes, name, tool, taught, at_speed))
    return None
