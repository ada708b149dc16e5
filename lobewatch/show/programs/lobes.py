"""Show stability lobes, their pockets, and how the pockets moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from acquisition import Remark, merge_remarks
from lobes import Pocket, PocketShift, StabilityLobes
from lobewatch.logbook import LobeComparison
from lobewatch.logbook.chart_data import NO_POCKET_CODE
from lobewatch.machine import REFERENCE_CUT
from lobewatch.show.programs.advice import setting_json
from lobewatch.show.programs.verdicts import at_speed_text, programs_json, verdict_table
from lobewatch.show.terminal.output import new_table, remark_json, remark_lines
from lobewatch.verdicts import Setting
from lobewatch.verdicts.setting_robustness import CHECKED_DROPS


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
        "remarks": [remark_json(remark) for remark in merge_remarks(remarks)],
    }


def comparison_texts(comparison: LobeComparison, remarks: Sequence[Remark]) -> list[str | Table]:
    """The diagram now, its pockets and the verdicts for people."""
    now = comparison.now
    texts: list[str | Table] = [
        f"{now.name}: {now.lobes.method_text}, from the {now.source} of {now.assembly.tap_id}",
        _lowest_limit_text(comparison),
        *shift_lines(comparison.shifts),
    ]
    if comparison.pockets:
        texts += [
            "safe now and until the next tap tests, the largest removal rate first:",
            pocket_table(comparison.pockets),
        ]
    texts += [str(remark) for remark in remarks if remark.code == NO_POCKET_CODE]
    if comparison.verdicts:
        texts += [
            verdict_table(comparison.verdicts),
            f"verdicts by {comparison.verdicts[0].method}, as lobewatch check",
        ]
        texts += _at_speed_lines(comparison)
    return [*texts, *remark_lines([remark for remark in remarks if remark.code != NO_POCKET_CODE])]


def _at_speed_lines(comparison: LobeComparison) -> list[str]:
    """What holds at rest and what at speed, where test cuts have taught of a program."""
    taught = [verdict for verdict in comparison.verdicts if verdict.n_cuts]
    if not taught:
        return []
    still = "the diagram and its pockets are" if comparison.now.name == REFERENCE_CUT else "the diagram is"
    return [f"{at_speed_text(taught)}; {still} of the spindle at rest"]


def _lowest_limit_text(comparison: LobeComparison) -> str:
    lobes, low = comparison.now.lobes, comparison.now.lobes.minimum
    if not np.isfinite(low.depth):
        return f"no limit in this speed range ({lobes.method_text})"
    return (
        f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm, chatter at {low.chatter_frequency:.1f} Hz"
    )


def pocket_table(pockets: Sequence[Setting]) -> Table:
    """Settings that can be recommended, a line each."""
    rows = new_table("pocket: speed (rpm)", "window (rpm)", "depth (mm)", "depth to spare", "fall left")
    for pocket in pockets:
        low, high = pocket.window_rpm
        left = f"{100 * pocket.drop_margin:.0f} %{' or more' if pocket.drop_margin >= CHECKED_DROPS[-1] else ''}"
        spare = f"{math.floor(100 * pocket.depth_margin + 1e-6)} %"
        rows.add_row(f"{pocket.speed_rpm:.0f}", f"{low:.0f}..{high:.0f}", f"{pocket.depth_mm:.2f}", spare, left)
    return rows


def shift_json(shift: PocketShift) -> dict[str, Any]:
    """A pocket of the diagram then and now."""
    return {
        "then": _pocket_tip_json(shift.before),
        "now": _pocket_tip_json(shift.after),
        "speed_change": shift.speed_change,
        "depth_change": shift.depth_change,
    }


def _pocket_tip_json(tip: Pocket) -> dict[str, float]:
    return {"speed_rpm": tip.speed_rpm, "depth_mm": tip.depth * 1e3, "from_rpm": tip.from_rpm, "to_rpm": tip.to_rpm}


def shift_lines(shifts: Sequence[PocketShift]) -> Iterator[str]:
    """The three fastest pockets that moved, a line each."""
    for shift in sorted(shifts, key=lambda shift: shift.before.speed_rpm, reverse=True)[:3]:
        yield (
            f"pocket of the diagram moved from {shift.before.speed_rpm:.0f} to {shift.after.speed_rpm:.0f} rpm "
            f"({100 * shift.speed_change:+.1f} %), its tip from {shift.before.depth * 1e3:.2f} to "
            f"{shift.after.depth * 1e3:.2f} mm ({100 * shift.depth_change:+.1f} %)"
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
