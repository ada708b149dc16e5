"""The lobes in the report: now and then with programs and test cuts, and how the pockets move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lobewatch.cuts.learning.lobes_at_speed import lobes_at_speed
from lobewatch.logbook import Logbook
from lobewatch.show.figures.lobe_figures import heard_of, lobes_figure, waterfall_figure
from lobewatch.show.figures.style import svg
from lobewatch.show.programs.advice import ProgramAdvice
from lobewatch.show.report.figure_data import lobe_numbers
from lobewatch.show.report.lobe_course import LobeCourse
from lobewatch.show.report.trend_pictures import Picture
from lobewatch.tool import Assembly, lobes_of
from lobewatch.verdicts.limit_band import limit_band


def lobe_figures(logbook: Logbook, assembly: Assembly, programs: Sequence[ProgramAdvice]) -> list[Picture]:
    """The diagram of the reference cut, or else of the first program of the tool, now and then."""
    machine = logbook.machine
    lobes = lobes_of(assembly, machine)
    if not lobes:
        return []
    cut, now = next(iter(lobes.items()))
    first = logbook.first_assembly(assembly)
    depths = {} if first is None else {first.label: lobes_of(first, machine)[cut].depth}
    text = (
        f"Limit of the {cut} by {now.method}, {' and '.join(assembly.directions)} direction"
        f"{'s' if len(assembly.directions) > 1 else ' alone'}; cuts above the band chatter. Marks: programs with this "
        "same cut and their verdicts; boxes: settings recommended instead, as in the table above."
    )
    if np.isinf(now.minimum.depth):
        text = f"The {cut} has no limit in this speed range ({now.method})."
    cuts = machine.cuts(assembly.tool)
    same = [one for one in programs if cuts.get(one.verdict.program.name) == cuts[cut]]
    advice = dict.fromkeys(setting for one in same for setting in (one.advice.best, one.advice.here) if setting)
    band = limit_band(now, cut, assembly, machine)
    marks = [one.verdict for one in same]
    depths |= {assembly.label: now.depth}
    heard = heard_of(logbook.cuts, cut, assembly.tool, cuts[cut][0])
    if heard:
        text += f" Rings and crosses: {len(heard)} test cut{'s' if len(heard) > 1 else ''}, as heard."
    learnt = lobes_at_speed(marks, machine)
    picture = lobes_figure(now.speed_rpm, depths, marks, "", band, list(advice), heard, learnt)
    edges = {} if band is None else {"lowest": band.low, "highest": band.high}
    if learnt is not None:
        edges |= {"at speed": learnt.lobes.depth, "at speed, lowest": learnt.band.low}
        edges |= {"at speed, highest": learnt.band.high}
    heading = "Stability lobes, then and now" if len(depths) > 1 else "Stability lobes"
    return [Picture(heading, text, svg(picture), lobe_numbers(now.speed_rpm, depths | edges))]


def pocket_figures(lobes: LobeCourse | None) -> list[Picture]:
    """The depths over speed and time: how the pockets move."""
    if lobes is None or not np.isfinite(lobes.depth).any():
        return []
    text = f"Limit of the {lobes.cut} by zero order after each tap test; bright is deep."
    picture = waterfall_figure(lobes.speed_rpm, lobes.times, lobes.depth)
    return [Picture("Pockets over time", text, svg(picture))]
