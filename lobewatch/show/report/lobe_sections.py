"""The lobes in the report: now and then with programs and test cuts, how the pockets move, and where they go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.learning.at_speed import LobesAtSpeed, lobes_at_speed
from lobewatch.show.figures.lobe_figures import heard_of, lobes_figure, waterfall_figure
from lobewatch.show.figures.style import svg
from lobewatch.show.report.figure_data import lobe_numbers
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.section import Download, Drawing, Fragment, Paragraph, Section
from lobewatch.tool import lobes_of
from lobewatch.verdicts.limit_band import LimitBand, limit_band

Floats = NDArray[np.float64]


def lobe_diagram(material: ReportMaterial) -> list[Section]:
    """The diagram of the reference cut, or else of the first program of the tool, now and then."""
    machine, assembly, analysis = material.machine, material.assembly, material.analysis
    lobes = lobes_of(assembly, machine)
    if not lobes:
        return []
    cut, now = next(iter(lobes.items()))
    first = analysis.first_assembly(assembly)
    depths = {} if first is None else {first.label: lobes_of(first, machine)[cut].depth}
    cuts = machine.cuts(assembly.tool)
    same = [program for program in material.programs if cuts.get(program.verdict.program.name) == cuts[cut]]
    settings = (setting for program in same for setting in (program.advice.best, program.advice.here) if setting)
    advice = list(dict.fromkeys(settings))
    band = limit_band(now, cut, assembly, machine)
    verdicts = [program.verdict for program in same]
    depths |= {assembly.label: now.depth}
    heard = heard_of(analysis.cuts, cut, assembly.tool, cuts[cut][0])
    text = f"The {cut} has no limit in this speed range ({now.method})."
    if not np.isinf(now.minimum.depth):
        text = _diagram_text(cut, now.method, assembly.directions)
    if heard:
        text += f" Rings and crosses: {len(heard)} test cut{'s' if len(heard) > 1 else ''}, as heard."
    learnt = lobes_at_speed(verdicts, machine)
    figure = lobes_figure(now.speed_rpm, depths, verdicts, "", band, advice, heard, learnt)
    heading = "Stability lobes, then and now" if len(depths) > 1 else "Stability lobes"
    numbers = lobe_numbers(now.speed_rpm, depths | _edges(band, learnt))
    return [Section(heading, [Paragraph(text, is_small=True), Drawing(svg(figure)), Download(numbers)])]


def _diagram_text(cut: str, method: str, directions: Sequence[str]) -> str:
    return (
        f"Limit of the {cut} by {method}, {' and '.join(directions)} direction"
        f"{'s' if len(directions) > 1 else ' alone'}; cuts above the band chatter. Marks: programs with this "
        "same cut and their verdicts; boxes: settings recommended instead, as in the table above."
    )


def _edges(band: LimitBand | None, learnt: LobesAtSpeed | None) -> dict[str, Floats]:
    """Depths beside that of now, by name."""
    edges = {} if band is None else {"lowest": band.low, "highest": band.high}
    if learnt is not None:
        edges |= {"at speed": learnt.lobes.depth, "at speed, lowest": learnt.band.low}
        edges |= {"at speed, highest": learnt.band.high}
    return edges


def pockets_over_time(material: ReportMaterial) -> list[Section]:
    """The depths over speed and time: how the pockets move."""
    course = material.lobe_course
    if course is None or not np.isfinite(course.depth).any():
        return []
    text = f"Limit of the {course.cut} by zero order after each tap test; bright is deep."
    figure = waterfall_figure(course.speed_rpm, course.times, course.depth)
    return [Section("Pockets over time", [Paragraph(text, is_small=True), Drawing(svg(figure)), Download(None)])]


def lobes_over_time(material: ReportMaterial) -> list[Section]:
    """The diagrams one by one, with a slider."""
    if material.lobe_course is None:
        return []
    return [Section("", [Fragment("lobe_course.html", {"course": material.lobe_course})], has_plot=True)]
