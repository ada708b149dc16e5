"""What `lobewatch lobes` draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from acquisition import DataError, Remark
from lobes import Cut, StabilityLobes, radial_lobes
from lobewatch.cuts.learning.at_speed import lobes_at_speed
from lobewatch.history import Row
from lobewatch.history.history_columns import row_lobes
from lobewatch.logbook import LobeComparison, Logbook
from lobewatch.machine import Machine
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.show.figures.lobe_figures import heard_of, lobes_figure, radial_figure, waterfall_figure
from lobewatch.show.figures.style import save_figure
from lobewatch.tool import Chart, Method, chart, speed_grid
from lobewatch.verdicts.limit_band import limit_band

IMMERSIONS = np.linspace(0.05, 1.0, 39)
MOST_LINES = 200
"""Tap tests of a waterfall."""


def save_pictures(
    logbook: Logbook,
    comparison: LobeComparison,
    method: Method,
    figure: Path | None,
    radial: Path | None,
    waterfall: Path | None,
) -> list[Remark]:
    """Write the pictures that have a file, all or none; returns what is to be said of them."""
    pictures, remarks = list[tuple[Figure, Path]](), list[Remark]()
    if figure is not None:
        pictures.append((lobes_picture(logbook.machine, comparison, logbook.cuts), figure))
    if radial is not None:
        picture, about = radial_picture(logbook.machine, comparison.now, method)
        pictures.append((picture, radial))
        remarks += [replace(remark, about="--radial") for remark in about]
    if waterfall is not None:
        pictures.append((waterfall_picture(logbook, comparison.now), waterfall))
    for picture, path in pictures:
        save_figure(picture, path)
    return remarks


def lobes_picture(machine: Machine, comparison: LobeComparison, cuts: Sequence[HeardCut]) -> Figure:
    """The diagram now in its doubt, beside the one then, with safe settings, programs and test cuts of the same cut."""
    now = comparison.now
    depths = {diagram.assembly.label: diagram.lobes.depth for diagram in (comparison.then, now) if diagram is not None}
    title = f"{_title(machine, now)}, from the {now.source}"
    band = limit_band(now.lobes, now.name, now.assembly, machine)
    heard = heard_of(cuts, now.name, now.assembly.tool, now.cuts[0])
    verdicts, pockets = comparison.verdicts, comparison.pockets
    learnt = lobes_at_speed(verdicts, machine)
    return lobes_figure(now.lobes.speed_rpm, depths, verdicts, title, band, pockets, heard, learnt)


def _title(machine: Machine, now: Chart) -> str:
    predicted = f", {now.assembly.label}" if now.assembly.predicted else ""
    return f"{machine.machine.name}: {now.name}\n{now.lobes.method}{predicted}"


def radial_picture(machine: Machine, now: Chart, method: Method) -> tuple[Figure, tuple[Remark, ...]]:
    """The limits over speed and radial depth, and what is wrong with the method at small ones."""
    speeds = now.lobes.speed_rpm if method is not Method.SEMI_DISCRETISATION else now.lobes.speed_rpm[::4]

    def limits(cut: Cut) -> StabilityLobes:
        cuts = [replace(simultaneous, immersion=cut.immersion) for simultaneous in now.cuts]
        return chart(method, now.x, now.y, cuts, speeds)

    radial = radial_lobes(limits, now.cuts[0], IMMERSIONS)
    diameter = now.table.tool_diameter_mm / 1e3
    return radial_figure(radial, diameter, now.cuts[0].immersion, _title(machine, now)), radial.remarks


def waterfall_picture(logbook: Logbook, now: Chart) -> Figure:
    """The limits over all tap tests of the series of the newest; DataError where there are no measured ones."""
    cut, tool = now.name, now.assembly.tool
    newest = None if now.assembly.predicted else logbook.measurement(now.assembly.tap_id)
    series = [] if newest is None else logbook.history.series(tool, newest.direction)
    shown = [row for row in _spread(series) if row.x]
    diagrams = [(row.time, lobes[cut]) for row in shown if cut in (lobes := row_lobes(row, logbook.machine, [cut]))]
    if not diagrams:
        raise DataError(f"--waterfall shows measured lobes; no tap test with tool {tool!r} has any of {cut!r}")
    title = f"{logbook.machine.machine.name}: {cut}\nzero order"
    depth = np.stack([lobes.depth for _, lobes in diagrams])
    return waterfall_figure(speed_grid(logbook.machine), [time for time, _ in diagrams], depth, title)


def _spread(rows: Sequence[Row]) -> list[Row]:
    """The first, the newest, and others evenly between them, no more than one can see."""
    return [rows[i] for i in np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_LINES)).round().astype(int))]
