"""Pockets and their shifts as JSON objects and as lines for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from acquisition import Remark, joined
from lobes import Pocket, PocketShift, StabilityLobes
from lobewatch.logbook import LobeComparison
from lobewatch.logbook.lobe_comparison import NO_POCKET
from lobewatch.machine import REFERENCE_CUT
from lobewatch.show.programs.describe_advice import setting_json
from lobewatch.show.programs.describe_doubts import at_speed_line
from lobewatch.show.programs.describe_verdicts import programs_json, verdict_table
from lobewatch.show.terminal.output import remark_json, remark_lines, table
from lobewatch.verdicts import Setting
from lobewatch.verdicts.room import LEFT


def comparison_json(comparison: LobeComparison, remarks: Sequence[Remark]) -> dict[str, Any]:
    """The diagram now, its pockets, and the verdicts on the programs with this cut."""
    lobes = comparison.now.lobes
    return lobes_json(comparison.now.name, lobes) | {
        "tap_id": comparison.now.assembly.tap_id,
        "source": str(comparison.now.source),
        "speed_rpm": lobes.speed_rpm,
        "depth_mm": lobes.depth * 1e3,
        "chatter_frequencies_hz": lobes.chatter_frequency,
        "kind": lobes.kind,
        "pockets": [setting_json(pocket) for pocket in comparison.pockets],
        "pocket_shifts": [shift_json(shift) for shift in comparison.shifts],
        "programs": programs_json(comparison.verdicts),
        "remarks": [remark_json(remark) for remark in joined(remarks)],
    }


def comparison_texts(comparison: LobeComparison, remarks: Sequence[Remark]) -> list[str | Table]:
    """The diagram now, its pockets and the verdicts for people."""
    now = comparison.now
    texts: list[str | Table] = [
        f"{now.name}: {now.lobes.stated_method}, from the {now.source} of {now.assembly.tap_id}",
        _limit_line(comparison),
        *shift_lines(comparison.shifts),
    ]
    if comparison.pockets:
        texts += [
            "safe now and until the next tap tests, the largest removal rate first:",
            pocket_table(comparison.pockets),
        ]
    texts += [str(remark) for remark in remarks if remark.code == NO_POCKET]
    if comparison.verdicts:
        texts += [
            verdict_table(comparison.verdicts),
            f"verdicts by {comparison.verdicts[0].method}, as lobewatch check",
        ]
        texts += _at_speed(comparison)
    return [*texts, *remark_lines([remark for remark in remarks if remark.code != NO_POCKET])]


def _at_speed(comparison: LobeComparison) -> list[str]:
    """What holds at rest and what at speed, where test cuts have taught of a program."""
    taught = [verdict for verdict in comparison.verdicts if verdict.cuts]
    if not taught:
        return []
    still = "the diagram and its pockets are" if comparison.now.name == REFERENCE_CUT else "the diagram is"
    return [f"{at_speed_line(taught)}; {still} of the spindle at rest"]


def _limit_line(comparison: LobeComparison) -> str:
    lobes, low = comparison.now.lobes, comparison.now.lobes.minimum
    if not np.isfinite(low.depth):
        return f"no limit in this speed range ({lobes.stated_method})"
    return (
        f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm, chatter at {low.chatter_frequency:.1f} Hz"
    )


def pocket_table(pockets: Sequence[Setting]) -> Table:
    """Settings that can be recommended, a line each."""
    rows = table("pocket: speed (rpm)", "window (rpm)", "depth (mm)", "depth to spare", "fall left")
    for pocket in pockets:
        low, high = pocket.window_rpm
        left = f"{100 * pocket.frequency_left:.0f} %{' or more' if pocket.frequency_left >= LEFT[-1] else ''}"
        spare = f"{math.floor(100 * pocket.depth_margin + 1e-6)} %"
        rows.add_row(f"{pocket.speed_rpm:.0f}", f"{low:.0f}..{high:.0f}", f"{pocket.depth_mm:.2f}", spare, left)
    return rows


def shift_json(shift: PocketShift) -> dict[str, Any]:
    """A pocket of the diagram then and now."""
    return {
        "then": _tip_json(shift.then),
        "now": _tip_json(shift.now),
        "speed_change": shift.speed_change,
        "depth_change": shift.depth_change,
    }


def _tip_json(tip: Pocket) -> dict[str, float]:
    return {"speed_rpm": tip.speed_rpm, "depth_mm": tip.depth * 1e3, "from_rpm": tip.from_rpm, "to_rpm": tip.to_rpm}


def shift_lines(shifts: Sequence[PocketShift]) -> Iterator[str]:
    """The three fastest pockets that moved, a line each."""
    for shift in sorted(shifts, key=lambda shift: shift.then.speed_rpm, reverse=True)[:3]:
        yield (
            f"pocket of the diagram moved from {shift.then.speed_rpm:.0f} to {shift.now.speed_rpm:.0f} rpm "
            f"({100 * shift.speed_change:+.1f} %), its tip from {shift.then.depth * 1e3:.2f} to "
            f"{shift.now.depth * 1e3:.2f} mm ({100 * shift.depth_change:+.1f} %)"
        )


def lobes_json(name: str, lobes: StabilityLobes) -> dict[str, Any]:
    """The lowest point of a diagram."""
    low = lobes.minimum
    return {
        "cut": name,
        "method": lobes.method,
        "method_detail": lobes.detail,
        "minimum_depth_mm": low.depth * 1e3,
        "at_speed_rpm": low.speed_rpm,
        "chatter_frequency_hz": low.chatter_frequency,
    }
