"""Show stability lobes, their pockets, and how the pockets moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.table import Table

from acquisition import Remark, merge_remarks
from lobes import PocketShift, StabilityLobes
from lobewatch.logbook import LobeComparison
from lobewatch.logbook.chart_data import NO_POCKET_CODE
from lobewatch.machine import REFERENCE_CUT
from lobewatch.show.programs.advice import setting_json
from lobewatch.show.programs.verdicts import at_speed_text, verdict_json, verdict_table
from lobewatch.show.terminal.output import JsonObject, Texts, json_fields, new_table, remark_lines
from lobewatch.verdicts import Setting
from lobewatch.verdicts.setting_robustness import CHECKED_DROPS

POCKET_TIP_FIELDS = json_fields("speed_rpm depth_mm=depth*1e3 from_rpm to_rpm")
SHIFT_FIELDS = json_fields(
    "then=before now=after speed_change depth_change", {"then": POCKET_TIP_FIELDS, "now": POCKET_TIP_FIELDS}
)
COMPARISON_FIELDS = json_fields(
    """
    tap_id=now.assembly.tap_id source=now.source speed_rpm=now.lobes.speed_rpm depth_mm=now.lobes.depth*1e3
    chatter_frequencies_hz=now.lobes.chatter_frequency kind=now.lobes.kind pockets pocket_shifts=shifts
    programs=verdicts
    """,
    {"pockets": setting_json, "pocket_shifts": SHIFT_FIELDS, "programs": verdict_json},
)
LOBES_FIELDS = json_fields("""
    method method_detail=detail minimum_depth_mm=minimum.depth*1e3 at_speed_rpm=minimum.speed_rpm
    chatter_frequency_hz=minimum.chatter_frequency
""")


def lobes_json(name: str, lobes: StabilityLobes) -> JsonObject:
    """Return the method and the lowest point of a diagram."""
    return {"cut": name} | LOBES_FIELDS(lobes)


def comparison_json(comparison: LobeComparison, remarks: Sequence[Remark]) -> JsonObject:
    """Return the newest diagram, its pockets, and the verdicts on the programs with this cut."""
    diagram = lobes_json(comparison.now.name, comparison.now.lobes) | COMPARISON_FIELDS(comparison)
    return diagram | {"remarks": merge_remarks(remarks)}


def comparison_texts(comparison: LobeComparison, remarks: Sequence[Remark]) -> Texts:
    """Return the newest diagram in words, its pockets, and the verdicts on the programs with this cut."""
    now, verdicts, low = comparison.now, comparison.verdicts, comparison.now.lobes.minimum
    lowest = f"lowest limit {low.depth * 1e3:.3f} mm at {low.speed_rpm:.0f} rpm"
    texts: Texts = [
        f"{now.name}: {now.lobes.method_text}, from the {now.source} of {now.assembly.tap_id}",
        f"{lowest}, chatter at {low.chatter_frequency:.1f} Hz"
        if math.isfinite(low.depth)
        else f"no limit in this speed range ({now.lobes.method_text})",
        *shift_lines(comparison.shifts),
    ]
    if comparison.pockets:
        heading = "safe now and until the next tap tests, the largest removal rate first:"
        texts += [heading, pocket_table(comparison.pockets)]
    texts += [str(remark) for remark in remarks if remark.code == NO_POCKET_CODE]
    if verdicts:
        texts += [verdict_table(verdicts), f"verdicts by {verdicts[0].method}, as lobewatch check"]
    if taught := [verdict for verdict in verdicts if verdict.n_cuts]:
        still = "the diagram and its pockets are" if now.name == REFERENCE_CUT else "the diagram is"
        texts.append(f"{at_speed_text(taught)}; {still} of the spindle at rest")
    return [*texts, *remark_lines([remark for remark in remarks if remark.code != NO_POCKET_CODE])]


def pocket_table(pockets: Sequence[Setting]) -> Table:
    """Return a table with a line for each recommended pocket."""
    table = new_table("pocket: speed (rpm)", "window (rpm)", "depth (mm)", "depth to spare", "fall left")
    for pocket in pockets:
        window = "{:.0f}..{:.0f}".format(*pocket.window_rpm)
        margin = f"{math.floor(100 * pocket.depth_margin + 1e-6)} %"
        drop = f"{100 * pocket.drop_margin:.0f} %{' or more' if pocket.drop_margin >= CHECKED_DROPS[-1] else ''}"
        table.add_row(f"{pocket.speed_rpm:.0f}", window, f"{pocket.depth_mm:.2f}", margin, drop)
    return table


def shift_lines(shifts: Sequence[PocketShift]) -> Iterator[str]:
    """Return a line for each of the three fastest pockets that moved."""
    for shift in sorted(shifts, key=lambda shift: shift.before.speed_rpm, reverse=True)[:3]:
        before, after = shift.before, shift.after
        yield (
            f"pocket of the diagram moved from {before.speed_rpm:.0f} to {after.speed_rpm:.0f} rpm "
            f"({100 * shift.speed_change:+.1f} %), its tip from {before.depth * 1e3:.2f} to "
            f"{after.depth * 1e3:.2f} mm ({100 * shift.depth_change:+.1f} %)"
        )
