"""What `lobewatch lobes` draws."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np
from matplotlib.figure import Figure

from acquisition import DataError, Remark
from lobes import (
    DepthBand,
    Pocket,
    best_pockets,
    coefficient_range,
    cutting_coefficients,
    measurement_band,
    radial_lobes,
)
from lobewatch.analysis.charts import Chart, Dynamics, Method, chart
from lobewatch.analysis.history import series, update_history
from lobewatch.analysis.pipeline import Measurement
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.machine_file import Machine
from lobewatch.show.describe import program_json
from lobewatch.show.figures_lobes import lobes_figure, radial_figure, waterfall_figure

IMMERSIONS = np.linspace(0.05, 1.0, 39)


def lobes_picture(folder: MachineFolder, now: Chart, then: Chart | None, best: Sequence[Pocket]) -> Figure:
    """The diagram now, beside the one then, with the programs of this same cut."""
    depths = {chart.label: chart.lobes.depth for chart in (then, now) if chart is not None}
    title = f"{_title(folder.machine, now)}, from the {now.source}"
    cuts = folder.machine.cuts(now.measurement.tool)
    same = program_json({name: now.lobes for name, other in cuts.items() if other == now.cut}, folder.machine)
    band, spread = _bands(folder.machine, now)
    return lobes_figure(now.lobes.speed_rpm, depths, same, title, band, spread, best_pockets(best))


def _bands(machine: Machine, now: Chart) -> tuple[DepthBand | None, DepthBand | None]:
    """Band of the measurement and range of the coefficients, each from zero order and carried over as ratios.

    None where modes have no standard errors, and where there are not two publications of one alloy.
    """
    if now.source is Dynamics.FRF:
        return None, None
    speeds = now.lobes.speed_rpm
    x, y = now.measurement.x, now.measurement.y
    base = chart(Method.ZERO_ORDER, x, y, now.cut, speeds).depth

    def carried(band: DepthBand) -> DepthBand:
        known = np.isfinite(base)
        low, high = (np.where(known, edge / np.where(known, base, 1.0), 1.0) for edge in band)
        return DepthBand(now.lobes.depth * low, now.lobes.depth * high)

    measured = spread = None
    if any(mode.best_covariance is not None for mode in (*(x or ()), *(y or ()))):
        measured = carried(measurement_band(lambda x, y: chart(Method.ZERO_ORDER, x, y, now.cut, speeds), x, y))
    used, known = machine.coefficients(now.table), cutting_coefficients()
    published = [one for one in known if any(used is other for other in known) and one.alloy == used.alloy]
    if len(published) >= 2:
        spread = carried(coefficient_range(lambda cut: chart(Method.ZERO_ORDER, x, y, cut, speeds), now.cut, published))
    return measured, spread


def _title(machine: Machine, now: Chart) -> str:
    predicted = f", {now.label}" if now.measurement.predicted else ""
    return f"{machine.machine.name}: {now.name}\n{now.lobes.method}{predicted}"


def radial_picture(machine: Machine, now: Chart, method: Method) -> tuple[Figure, tuple[Remark, ...]]:
    """The limits over speed and radial depth, and what is wrong with the method at small ones."""
    speeds = now.lobes.speed_rpm if method is not Method.SEMI_DISCRETISATION else now.lobes.speed_rpm[::4]
    found = radial_lobes(lambda cut: chart(method, now.x, now.y, cut, speeds), now.cut, IMMERSIONS)
    diameter = now.table.tool_diameter_mm / 1e3
    return radial_figure(found, diameter, now.cut.immersion, _title(machine, now)), found.remarks


def waterfall_picture(folder: MachineFolder, newest: Measurement, cut: str) -> Figure:
    """The limits over all tap tests of a series; DataError where it has none."""
    with folder.locked():
        history, _ = update_history(folder)
    rows = series(history, newest.tool, newest.direction)
    rows = rows[~np.isnan(history.depth[cut][rows, 0])]
    if not rows.size:
        raise DataError(f"--waterfall shows measured lobes; no tap test with tool {newest.tool!r} has any of {cut!r}")
    times = [datetime.fromisoformat(text) for text in history.columns["time"][rows]]
    title = f"{folder.machine.machine.name}: {cut}\nzero order"
    return waterfall_figure(history.speed_rpm, times, history.depth[cut][rows], title)
