"""The report of one machine: one HTML file with everything in it."""

from __future__ import annotations

from datetime import datetime
from importlib import resources
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, TapTest
from lobes import SldHistory
from lobewatch.figures import frf_figure, svg, trend_figure
from lobewatch.figures_lobes import lobes_figure
from lobewatch.history import series
from lobewatch.machine import Machine
from lobewatch.machine_folder import MachineFolder
from lobewatch.output import plus_minus


def render_report(folder: MachineFolder, history: SldHistory, tool: str, direction: str) -> str:
    """HTML of one series (tool and direction); ValueError where it holds no tap test."""
    rows = series(history, tool, direction)
    if not rows.size:
        raise ValueError(f"{folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    source = resources.files("lobewatch").joinpath("report.html").read_text(encoding="utf-8")
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
    programs = _programs(machine, history, first, last)
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
        "programs": programs,
        "notes": [note for note in str(columns["notes"][last]).splitlines() if note],
        "modes": _modes(history, last),
        "operator": now.circumstances.operator,
        "tap_id": now.id,
        "good": len(now.accepted),
        "hits": len(now.hits),
        "averages": now.frf.n_averages,
        "figures": _figures(machine, history, rows, times, (then, now), programs),
        "limits": machine.limits,
    }


def _figures(
    machine: Machine,
    history: SldHistory,
    rows: NDArray[np.int64],
    times: list[datetime],
    taps: tuple[TapTest, TapTest],
    programs: list[dict[str, Any]],
) -> list[tuple[str, str, str]]:
    """Heading, sentence and picture of each figure that there is something to show in."""
    columns = history.columns
    figures: list[tuple[str, str, str]] = []
    cut = machine.cut_names[0] if machine.cut_names else None
    if cut is not None and not np.isnan(history.depth[cut][rows[-1], 0]):
        then, now = history.depth[cut][rows[0]], history.depth[cut][rows[-1]]
        depths = {f"{times[0]:%Y-%m-%d}": then} if rows.size > 1 and not np.isnan(then[0]) else {}
        depths[f"{times[-1]:%Y-%m-%d}"] = now
        picture = lobes_figure(history.speed_rpm, depths, [p for p in programs if p["same_as_reference"]])
        text = f"Limit of the {cut}; cuts in the shaded region chatter. Marks: programs with this same cut."
        figures.append(("Stability lobes, then and now", text, svg(picture)))
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


def _programs(machine: Machine, history: SldHistory, first: int, last: int) -> list[dict[str, Any]]:
    """Programs that have a limit now, with their verdict then and now."""
    if not machine.program:
        return []
    limits = history.columns["program_limit"]
    reference = machine.reference_cut
    return [
        {
            "name": program.name,
            "speed_rpm": program.speed_rpm,
            "depth_mm": program.depth_mm,
            "then_mm": limits[first, i] * 1e3,
            "limit_mm": limits[last, i] * 1e3,
            "was_stable": bool(program.depth_mm < limits[first, i] * 1e3),
            "stable": bool(program.depth_mm < limits[last, i] * 1e3),
            "same_as_reference": reference is not None and machine.build_cut(program) == machine.build_cut(reference),
        }
        for i, program in enumerate(machine.program)
        if not np.isnan(limits[last, i])
    ]
