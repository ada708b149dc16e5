"""The stability lobes of the first cut of a tool, now and at first, with the programs of the same cut on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lobes import StabilityLobes
from lobewatch.cuts.learning.at_speed import LobesAtSpeed, lobes_at_speed
from lobewatch.logbook.analysis import Analysis
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.show.figures.lobe_figures import heard_of, lobes_figure
from lobewatch.show.programs.describe_advice import ProgramAdvice
from lobewatch.tool import Assembly, lobes_of
from lobewatch.verdicts import Setting, Verdict
from lobewatch.verdicts.limit_band import LimitBand, limit_band

Floats = NDArray[np.float64]


class LobeDiagram(NamedTuple):
    """What is drawn of one cut."""

    cut: str
    """Name of the cut: the reference cut, or else the first program of the tool."""
    now: StabilityLobes
    """Lobes of the newest tap tests."""
    depths: Mapping[str, Floats]
    """Limiting depths at first, where that is known, and now (m), shape (n,), by the dates of the tap tests."""
    verdicts: Sequence[Verdict]
    """Verdicts on the programs with the same cut."""
    advice: Sequence[Setting]
    """Settings recommended for them."""
    band: LimitBand | None
    """How far the doubt moves the limit."""
    heard: Sequence[HeardCut]
    """Test cuts of the same cut."""
    learnt: LobesAtSpeed | None
    """What test cuts have taught of the turning spindle."""

    def figure(self, *, is_small: bool = False) -> Figure:
        """The picture; a small one stands beside words."""
        return lobes_figure(
            self.now.speed_rpm,
            self.depths,
            self.verdicts,
            "",
            self.band,
            self.advice,
            self.heard,
            self.learnt,
            is_small=is_small,
        )

    @property
    def edges(self) -> dict[str, Floats]:
        """Depths beside those of now and of then (m), by name."""
        edges = {} if self.band is None else {"lowest": self.band.low, "highest": self.band.high}
        if self.learnt is not None:
            edges |= {"at speed": self.learnt.lobes.depth, "at speed, lowest": self.learnt.band.low}
            edges |= {"at speed, highest": self.learnt.band.high}
        return edges


def lobe_diagram(analysis: Analysis, assembly: Assembly, programs: Sequence[ProgramAdvice]) -> LobeDiagram | None:
    """The diagram of a tool as tapped; None where it has no lobes."""
    machine = analysis.machine
    lobes = lobes_of(assembly, machine)
    if not lobes:
        return None
    cut, now = next(iter(lobes.items()))
    first = analysis.first_assembly(assembly)
    depths = {} if first is None else {first.label: lobes_of(first, machine)[cut].depth}
    cuts = machine.cuts(assembly.tool)
    same = [program for program in programs if cuts.get(program.verdict.program.name) == cuts[cut]]
    settings = (setting for program in same for setting in (program.advice.best, program.advice.here) if setting)
    verdicts = [program.verdict for program in same]
    return LobeDiagram(
        cut,
        now,
        depths | {assembly.label: now.depth},
        verdicts,
        list(dict.fromkeys(settings)),
        limit_band(now, cut, assembly, machine),
        heard_of(analysis.cuts, cut, assembly.tool, cuts[cut][0]),
        lobes_at_speed(verdicts, machine),
    )
