"""The pictures of the report: values over time, lobes then and now, how the pockets move, the frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from lobewatch.cuts.learning.at_speed import LobesAtSpeed, lobes_at_speed
from lobewatch.machine import Machine
from lobewatch.show.figures.lobe_figures import heard_of, lobes_figure, waterfall_figure
from lobewatch.show.figures.trend_figures import Marks, course_of, frf_figure, trend_figure
from lobewatch.show.report.figure_data import lobe_numbers, response_numbers, value_numbers
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.section import Fragment, Section, picture_section
from lobewatch.tool import lobes_of
from lobewatch.verdicts.limit_band import LimitBand, limit_band

Floats = NDArray[np.float64]

NEAR = 0.15
"""Relative distance from all that counts up to which a value that does not count is drawn."""
BELOW, ABOVE = 0.6, 1.4
"""Ends of the frequencies shown over those of the usable band; chosen."""


class SeriesValue(NamedTuple):
    """A value of the tap tests of a series that is shown over time."""

    field: str
    """Name of the field of a row."""
    heading: str
    """Heading of its section."""
    unit: str
    """Unit that it is shown in."""
    scale: float
    """Size of that unit (SI)."""
    text: str
    """Sentence on how to read it."""


VALUES = (
    SeriesValue("frequency", "Natural frequency", "Hz", 1.0, "Bars: 95 % interval of each tap alone."),
    SeriesValue(
        "bearing_stiffness", "Bearing stiffness", "N/µm", 1e6, "Equivalent stiffness of each bearing in the model."
    ),
)


def pictures(material: ReportMaterial) -> list[Section]:
    """A section for each picture that there is something to draw for."""
    makers = values_over_time, lobe_diagram, pockets_over_time, frequency_response
    return [section for make in makers for section in make(material)]


def values_over_time(material: ReportMaterial) -> list[Section]:
    """A picture of each value that is known."""
    return [section for value in VALUES if (section := _value_over_time(material, value)) is not None]


def _value_over_time(material: ReportMaterial, value: SeriesValue) -> Section | None:
    rows, scale, text = material.rows, value.scale, value.text
    since = rows[0].time if rows[0].baseline is None else rows[0].baseline
    events = [(event.time, event.text) for event in material.analysis.files.events if event.time >= since]
    estimates = [(row.time, getattr(row, value.field)) for row in rows if getattr(row, value.field).is_known]
    if not estimates:
        return None
    values, stds = np.array([estimate for _, estimate in estimates]).T / scale
    near = (1 - NEAR) * values.min(), (1 + NEAR) * values.max()
    aside = [(row.time, getattr(row, value.field).value / scale) for row in material.excluded_rows]
    marks = Marks(events, [(time, number) for time, number in aside if near[0] <= number <= near[1]])
    is_followed, trend = value.field == "frequency", material.series.trend
    limits = material.machine.limits if is_followed else None
    course = course_of(trend) if trend is not None and is_followed else None
    text += " Dotted lines: what was done." if events else ""
    text += " Hollow: tests that do not count." if marks.hollow else ""
    text += " Line: fitted; band: where it goes, 80 %." if course else ""
    label = f"{value.heading.lower()} ({value.unit})"
    figure = trend_figure([time for time, _ in estimates], values, stds, label, limits, marks, course)
    numbers = value_numbers(label, scale, estimates, aside, course)
    return picture_section(value.heading, text, figure, numbers)


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
    return [picture_section(heading, text, figure, numbers)]


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
    return [picture_section("Pockets over time", text, figure)]


def frequency_response(material: ReportMaterial) -> list[Section]:
    """Receptance of the newest test, and of the first; nothing where no force was measured."""
    first, newest = material.first, material.newest.frf
    if newest is None:
        return []
    band = _shown_band(newest, material.machine)
    figure = frf_figure(None if first is None else first.frf, newest, band)
    text, numbers = "Receptance: displacement over force.", response_numbers(newest.in_band(band))
    return [picture_section("Frequency response", text, figure, numbers)]


def _shown_band(frf: Frf, machine: Machine) -> tuple[float, float]:
    low, high = machine.mode.band_hz or frf.usable_band or (float(frf.frequency[0]), float(frf.frequency[-1]))
    return max(BELOW * low, float(frf.frequency[0])), min(ABOVE * high, float(frf.frequency[-1]))


def lobes_over_time(material: ReportMaterial) -> list[Section]:
    """The diagrams one by one, with a slider."""
    if material.lobe_course is None:
        return []
    return [Section("", [Fragment("lobe_course.html", {"course": material.lobe_course})], has_plot=True)]
