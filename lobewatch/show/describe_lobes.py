"""Pockets, their shifts and cutting coefficients as JSON objects and as lines for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from acquisition import Remark
from lobes import Pocket, PocketShift, ProgramCheck, cutting_coefficients
from lobes.check_program import DEEPEST
from lobes.pockets import SHARE
from lobewatch.machine.machine_file import Machine

POCKET_RANGE = f"at least {100 * SHARE:.0f} % of the depth"
"""What holds between the ends of a pocket."""
OUT_OF_RANGE = frozenset({"low-immersion", "fast-teeth", "force-cancels"})
"""Codes of what another method is the cure of."""


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


def limit_text(found: ProgramCheck, depth_mm: float) -> str:
    """The limit of a program of this depth (mm)."""
    return f"> {DEEPEST * depth_mm:g}" if math.isinf(found.limit) else f"{found.limit * 1e3:.2f}"


def margin_text(found: ProgramCheck) -> str:
    """The margin of a program in depth."""
    return "-" if math.isinf(found.depth_margin) else f"{100 * found.depth_margin:+.0f} %"


def with_option(remark: Remark) -> str:
    """A remark on a method, with the option of `lobewatch lobes` for what it asks for."""
    option = " (--method semi-discretisation)" if remark.code in OUT_OF_RANGE else ""
    return f"{remark}{option}"


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
