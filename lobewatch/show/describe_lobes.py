"""Pockets, their shifts and cutting coefficients as JSON objects and as lines for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from acquisition import Remark, joined
from lobes import Pocket, PocketShift, best_pockets, cutting_coefficients
from lobes.pockets import SHARE
from lobewatch.analysis import LobeComparison
from lobewatch.analysis.lobe_comparison import USEFUL
from lobewatch.machine import Machine
from lobewatch.show.measurements import lobes_json, programs_json, remark_json, remark_lines
from lobewatch.show.verdicts import verdict_table

POCKET_RANGE = f"at least {100 * SHARE:.0f} % of the depth"
"""What holds between the ends of a pocket."""


def pocket_json(pocket: Pocket) -> dict[str, float]:
    """One pocket."""
    return {
        "speed_rpm": pocket.speed_rpm,
        "depth_mm": pocket.depth * 1e3,
        "from_rpm": pocket.from_rpm,
        "to_rpm": pocket.to_rpm,
    }


def pocket_list(best: Sequence[Pocket]) -> str:
    """Pockets in one line, in brackets the speeds at which POCKET_RANGE holds."""
    texts = (
        f"{pocket.depth * 1e3:.2f} mm at {pocket.speed_rpm:.0f} ({pocket.from_rpm:.0f}..{pocket.to_rpm:.0f}) rpm"
        for pocket in best
    )
    return ", ".join(texts) or "none"


def comparison_json(found: LobeComparison, remarks: Sequence[Remark]) -> dict[str, Any]:
    """The diagram now, its pockets, and the verdicts on the programs with this cut."""
    lobes = found.now.lobes
    return lobes_json(found.now.name, lobes) | {
        "tap_id": found.now.assembly.tap_id,
        "source": str(found.now.source),
        "speed_rpm": lobes.speed_rpm,
        "depth_mm": lobes.depth * 1e3,
        "chatter_frequencies_hz": lobes.chatter_frequency,
        "kind": lobes.kind,
        "pockets_by_depth": [pocket_json(pocket) for pocket in best_pockets(found.pockets)],
        "pockets_by_removal": [pocket_json(pocket) for pocket in best_pockets(found.pockets, by="removal")],
        "pocket_shifts": [shift_json(shift) for shift in found.shifts],
        "programs": programs_json(found.verdicts),
        "remarks": [remark_json(remark) for remark in joined(remarks)],
    }


def comparison_texts(found: LobeComparison, remarks: Sequence[Remark]) -> list[str | Table]:
    """The same for people."""
    now = found.now
    texts: list[str | Table] = [
        f"{now.name}: {now.lobes.stated_method}, from the {now.source} of {now.assembly.tap_id}",
        *_limit_lines(found),
        *shift_lines(found.shifts),
    ]
    if found.verdicts:
        texts += [verdict_table(found.verdicts), f"verdicts by {found.verdicts[0].method}, as lobewatch check"]
    return [*texts, *remark_lines(remarks)]


def _limit_lines(found: LobeComparison) -> list[str]:
    lobes, best = found.now.lobes, found.pockets
    low = lobes.minimum
    if not np.isfinite(low.depth):
        return [f"no limit in this speed range ({lobes.stated_method})"]
    return [
        f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm, chatter at {low.chatter_frequency:.1f} Hz",
        f"best pockets up to {USEFUL * low.depth * 1e3:.1f} mm (in brackets: {POCKET_RANGE}), by depth: "
        f"{pocket_list(best_pockets(best))}",
        f"by removal rate: {pocket_list(best_pockets(best, by='removal'))}",
    ]


def shift_json(shift: PocketShift) -> dict[str, Any]:
    """A pocket then and now."""
    return {
        "then": pocket_json(shift.then),
        "now": pocket_json(shift.now),
        "speed_change": shift.speed_change,
        "depth_change": shift.depth_change,
    }


def shift_lines(shifts: Sequence[PocketShift]) -> Iterator[str]:
    """The three fastest pockets that moved, a line each."""
    for shift in sorted(shifts, key=lambda one: one.then.speed_rpm, reverse=True)[:3]:
        yield (
            f"pocket moved from {shift.then.speed_rpm:.0f} to {shift.now.speed_rpm:.0f} rpm "
            f"({100 * shift.speed_change:+.1f} %), {shift.then.depth * 1e3:.2f} to {shift.now.depth * 1e3:.2f} mm "
            f"({100 * shift.depth_change:+.1f} %)"
        )


def materials_json(machine: Machine) -> list[dict[str, Any]]:
    """Cutting coefficients of one's own, then the published ones."""
    return [
        {
            "material": one.material,
            "tangential_n_per_mm2": one.tangential / 1e6,
            "radial_n_per_mm2": one.radial / 1e6,
            "note": one.note,
            "source": one.source,
        }
        for one in (*(own.build() for own in machine.material), *cutting_coefficients())
    ]


def material_lines(machine: Machine) -> Iterator[str]:
    """The same, a line each."""
    for one in materials_json(machine):
        kt, kr = one["tangential_n_per_mm2"], one["radial_n_per_mm2"]
        about = "; ".join(filter(None, (one["note"], one["source"])))
        yield f"{one['material']:<42} Kt {kt:5.0f}  Kr {kr:4.0f} N/mm²  {about}"
