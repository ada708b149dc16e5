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
    for found in verdicts:
        known, name = found.assembly, found.program.name
        if known is None or not known.cuts:
            continue
        taught = msgspec.structs.replace(machine, program=(found.program,))
        lobes = tip_lobes(known.tool, known.x, known.y, taught, [name])[name]
        return LobesAtSpeed(known.cuts, lobes, limit_band(lobes, name, known, taught))
    return None
