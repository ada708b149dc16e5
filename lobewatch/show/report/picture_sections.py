"""The pictures of the report: values over time, lobes then and now, how the pockets move, the frequency response."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lobewatch.show.figures.lobe_figures import waterfall_figure
from lobewatch.show.figures.trend_figures import frf_figure
from lobewatch.show.report.figure_data import lobe_numbers, response_numbers, value_numbers
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.section import Fragment, Section, picture_section
from lobewatch.show.report.value_over_time import BEARINGS, FREQUENCY, SeriesValue, value_over_time


def pictures(material: ReportMaterial) -> list[Section]:
    """A section for each picture that there is something to draw for."""
    makers = values_over_time, lobes_then_and_now, pockets_over_time, frequency_response
    return [section for make in makers for section in make(material)]


def values_over_time(material: ReportMaterial) -> list[Section]:
    """A picture of each value that is known."""
    return [section for value in (FREQUENCY, BEARINGS) if (section := _value_section(material, value)) is not None]


def _value_section(material: ReportMaterial, value: SeriesValue) -> Section | None:
    points = value_over_time(material, value)
    if points is None:
        return None
    text = value.text
    text += " Dotted lines: what was done." if points.marks.events else ""
    text += " Hollow: tests that do not count." if points.marks.hollow else ""
    text += " Line: fitted; band: where it goes, 80 %." if points.course else ""
    numbers = value_numbers(value.label, value.scale, points.estimates, points.aside, points.course)
    return picture_section(value.heading, text, points.figure(), numbers)


def lobes_then_and_now(material: ReportMaterial) -> list[Section]:
    """The diagram of the reference cut, or else of the first program of the tool, now and then."""
    diagram = material.lobe_diagram
    if diagram is None:
        return []
    text = f"The {diagram.cut} has no limit in this speed range ({diagram.now.method})."
    if not np.isinf(diagram.now.minimum.depth):
        text = _diagram_text(diagram.cut, diagram.now.method, material.assembly.directions)
    if diagram.heard:
        text += f" Rings and crosses: {len(diagram.heard)} test cut{'s' if len(diagram.heard) > 1 else ''}, as heard."
    heading = "Stability lobes, then and now" if len(diagram.depths) > 1 else "Stability lobes"
    numbers = lobe_numbers(diagram.now.speed_rpm, {**diagram.depths, **diagram.edges})
    return [picture_section(heading, text, diagram.figure(), numbers)]


def _diagram_text(cut: str, method: str, directions: Sequence[str]) -> str:
    return (
        f"Limit of the {cut} by {method}, {' and '.join(directions)} direction"
        f"{'s' if len(directions) > 1 else ' alone'}; cuts above the band chatter. Marks: programs with this "
        "same cut and their verdicts; boxes: settings recommended instead, as in the table above."
    )


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
    band = material.response_band(newest)
    figure = frf_figure(None if first is None else first.frf, newest, band)
    text, numbers = "Receptance: displacement over force.", response_numbers(newest.in_band(band))
    return [picture_section("Frequency response", text, figure, numbers)]


def lobes_over_time(material: ReportMaterial) -> list[Section]:
    """The diagrams one by one, with a slider."""
    if material.lobe_course is None:
        return []
    return [Section("", [Fragment("lobe_course.html", {"course": material.lobe_course})], has_plot=True)]
