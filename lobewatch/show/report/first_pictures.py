"""Pictures of the first screen, beside its words: where the frequency goes, and the lobes with the programs on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lobewatch.show.figures.lobe_figures import SMALL
from lobewatch.show.figures.style import svg
from lobewatch.show.figures.trend_figures import frf_figure
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.value_over_time import FREQUENCY, value_over_time


class FirstPicture(NamedTuple):
    """A small picture."""

    caption: str
    """What it shows."""
    svg: str
    """The <svg> element."""


def first_pictures(material: ReportMaterial) -> Iterator[FirstPicture]:
    """Course of the frequency, or the response of an only tap test; lobes where there are any."""
    points, diagram = value_over_time(material, FREQUENCY), material.lobe_diagram
    if points is not None:
        ahead = ", and where it goes" if points.course is not None else ""
        caption = f"Natural frequency in {material.last.direction} (Hz){ahead}"
        figure = points.figure(SMALL)
        figure.axes[0].set_ylabel("")  # its name is the caption, for letters on a phone are large
        yield FirstPicture(caption, svg(figure))
    elif (frf := material.newest.frf) is not None:
        figure = frf_figure(None, frf, material.response_band(frf), SMALL)
        yield FirstPicture("Receptance at the tool tip", svg(figure))
    if diagram is not None:
        then = "; dashed: at first" if len(diagram.depths) > 1 else ""
        caption = f"Depth (mm), {diagram.cut}: chatter above the line{then}"
        yield FirstPicture(caption, svg(diagram.figure(is_small=True)))
