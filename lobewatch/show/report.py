"""The report of one machine: one HTML file with everything in it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from importlib import resources
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, TapTest
from dsm import plus_minus
from lobes import ProgramCheck, SldHistory
from lobewatch.analysis.advice import ProgramAdvice, advise
from lobewatch.analysis.history import measure, series
from lobewatch.analysis.pipeline import Measurement
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.machine_file import Machine
from lobewatch.show.describe_lobes import limit_text, margin_text
from lobewatch.show.figures import frf_figure, svg, trend_figure
from lobewatch.show.figures_lobes import lobes_figure


def render_report(folder: MachineFolder, history: SldHistory, tool: str, direction: str) -> str:
    """HTML of one series (tool and direction); ValueError where it holds no tap test."""
    rows = series(history, tool, direction)
    if not rows.size:
        raise ValueError(f"{folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    source = resources.files("lobewatch.show").joinpath("report.html").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(source).render(_content(folder, history, rows, tool, direction))


def _content(
    folder: MachineFolder, history: SldHistory, rows: NDArray[np.int64], tool: str, direction: str
) -> dict[str, Any]:
    machine, columns = folder.machine, history.columns
    first, last = int(rows[0]), int(rows[-1])
    times = [datetime.fromisoformat(text) for text in columns["time"][rows]]
    taps = {entry.id: entry for entry in folder.taps()}
    now, then = (folder.read(taps[columns["tap_id"][row]]) for row in (last, first))
    measured = [measure(folder, taps[columns["tap_id"][row]]) for row in (first, last)]
    advice = advise(folder)
    return {
        "name": machine.machine.name,
        "tool": tool,
        "direction": direction,
        "first": times[0],
        "last": times[-1],
        "n_taps": rows.size,
        "software": history.software,
        "label": machine.spindle.label if machine.spindle else "",
        "changes": _changes(history, first, last),
        "programs": [_program(one) for one in advice],
        "program_method": next((one.check.method for one in advice if one.check is not None), ""),
        "notes": [note for note in str(columns["notes"][last]).splitlines() if note],
        "modes": _modes(history, last),
        "operator": now.circumstances.operator,
        "tap_id": now.id,
        "good": len(now.accepted),
        "hits": len(now.hits),
        "averages": now.frf.n_averages,
        "figures": [
            *_lobes(machine, measured[0], measured[1], advice),
            *_figures(machine, history, rows, times, (then, now)),
        ],
        "limits": machine.limits,
    }


def _lobes(
    machine: Machine, first: Measurement, last: Measurement, advice: Sequence[ProgramAdvice]
) -> list[tuple[str, str, str]]:
    """The diagram of the reference cut, or else of the first program of the tool, now and then."""
    if not last.lobes:
        return []
    cut, now = next(iter(last.lobes.items()))
    known = (bool(last.x), bool(last.y))
    then = first.lobes.get(cut) if first.tap_id != last.tap_id else None
    text = (
        f"Limit of the {cut} by {now.stated_method}; cuts in the shaded region chatter. "
        "Marks: programs with this same cut, as in the table above."
    )
    if np.isinf(now.minimum.depth):
        text = f"The {cut} has no limit in this speed range ({now.stated_method})."
    if then is not None and (bool(first.x), bool(first.y)) != known:
        then, text = None, f"{text} The first test knows other directions than the newest: no comparison."
    depths = {f"{first.time:%Y-%m-%d}": then.depth} if then is not None else {}
    depths[f"{last.time:%Y-%m-%d}"] = now.depth
    cuts = machine.cuts(last.tool)
    marks = [
        _program(one)
        for one in advice
        if one.check is not None and one.table.name in cuts and cuts[one.table.name] == cuts[cut]
    ]
    picture = lobes_figure(now.speed_rpm, depths, marks)
    return [("Stability lobes, then and now" if then is not None else "Stability lobes", text, svg(picture))]


def _figures(
    machine: Machine,
    history: SldHistory,
    rows: NDArray[np.int64],
    times: list[datetime],
    taps: tuple[TapTest, TapTest],
) -> list[tuple[str, str, str]]:
    """Heading, sentence and picture of each figure that there is something to show in."""
    columns = history.columns
    figures: list[tuple[str, str, str]] = []
    for name, label, limits, text in (
        ("frequency", "natural frequency (Hz)", machine.limits, "Bars: 95 % interval of each tap alone."),
        ("bearing_stiffness", "bearing stiffness (N/µm)", None, "Equivalent stiffness of each bearing in the model."),
    ):
        values, stds = (np.asarray(columns[key][rows], dtype=np.float64) for key in (name, f"{name}_std"))
        seen = np.isfinite(values)
        if seen.any():
            scale = 1.0 if limits else 1e6
            at = [time for time, is_seen in zip(times, seen, strict=True) if is_seen]
            figure = trend_figure(at, values[seen] / scale, stds[seen] / scale, label, limits)
            figures.append((label.partition(" (")[0].capitalize(), text, svg(figure)))
    first = taps[0].frf if rows.size > 1 else None
    picture = frf_figure(first, taps[1].frf, _shown_band(taps[1].frf, machine))
    figures.append(("Frequency response", "Receptance: displacement over force.", svg(picture)))
    return figures


def _shown_band(frf: Frf, machine: Machine) -> tuple[float, float]:
    low, high = machine.mode.band_hz or frf.usable_band or (float(frf.frequency[0]), float(frf.frequency[-1]))
    return max(0.6 * low, float(frf.frequency[0])), min(1.4 * high, float(frf.frequency[-1]))


def _changes(history: SldHistory, first: int, last: int) -> list[dict[str, str]]:
    columns = history.columns
    table = []
    for name, label, scale in (
        ("frequency", "natural frequency (Hz)", 1.0),
        ("damping_ratio", "damping ratio (%)", 0.01),
        ("stiffness", "stiffness K (N/µm)", 1e6),
        ("bearing_stiffness", "bearing stiffness (N/µm)", 1e6),
        ("static_tip_stiffness", "static tip stiffness, model (N/µm)", 1e6),
        ("modal_tip_stiffness", "modal tip stiffness, model (N/µm)", 1e6),
    ):
        values = columns[name]
        stds = columns.get(f"{name}_std", np.full(values.shape, np.nan))
        if not np.isfinite(values[last]):
            continue
        row = {"label": label, "now": plus_minus(values[last], stds[last], scale)}
        row["then"] = plus_minus(values[first], stds[first], scale)
        row["change"] = f"{100 * (values[last] / values[first] - 1):+.2f} %" if np.isfinite(values[first]) else "-"
        table.append(row)
    return table


def _modes(history: SldHistory, row: int) -> list[dict[str, str]]:
    columns = history.columns
    values = np.stack([columns[f"mode_{name}"][row] for name in ("frequency", "damping_ratio", "stiffness")], axis=1)
    return [
        {
            "frequency": f"{frequency:.2f}",
            "damping": f"{damping * 100:.3f}",
            "stiffness": f"{stiffness / 1e6:.3f}",
            "remark": "" if stiffness > 0 else "not a driving point",
        }
        for frequency, damping, stiffness in values[np.isfinite(values[:, 0])]
    ]


def _program(one: ProgramAdvice) -> dict[str, Any]:
    """A row of the table of programs: what `lobewatch check` says."""
    row = {"name": one.table.name, "speed_rpm": one.table.speed_rpm, "depth_mm": one.table.depth_mm}
    found = one.check
    if found is None:
        return row | {
            "stable": None,
            "was_stable": None,
            "limit": "-",
            "band": "",
            "margin": "-",
            "remark": "; ".join(one.notes),
        }
    low, high = (edge * 1e3 for edge in one.limit_band)
    return row | {
        "stable": found.stable,
        "was_stable": one.was_stable if one.measured else None,
        "limit": limit_text(found, one.table.depth_mm),
        "band": f"{low:.2f} to {high:.2f}" if np.isfinite(high) else "",
        "margin": margin_text(found),
        "remark": _remark(one, found, low),
    }


def _remark(one: ProgramAdvice, found: ProgramCheck, low: float) -> str:
    remarks = [] if one.measured else ["predicted"]
    if found.stable and low <= one.table.depth_mm:
        remarks.append("within the error of the limit")
    if one.table.depth_mm > one.drive_limit * 1e3:
        remarks.append(f"[drive] allows {one.drive_limit * 1e3:.2f} mm")
    return "; ".join(remarks)
