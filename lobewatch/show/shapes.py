"""Texts and JSON of mode shapes along the tool axis."""

from collections import Counter
from collections.abc import Sequence

from rich.table import Table

from dsm import format_with_error
from lobewatch.arrays import Floats
from lobewatch.measurement import FolderShapes, MeasuredPoint, PointCheck, compare_shapes
from lobewatch.show.modes import count_by_trust, grouped_remark_lines, mode_json, mode_remark_lines, mode_table
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick
from modal import ModeShape, PartShare


def folder_shapes_json(found: FolderShapes, reference: FolderShapes | None = None) -> JsonObject:
    """Return the mode shapes of a folder, with the MAC of the accepted modes; reference: an earlier set to compare."""
    shares = zip(found.shapes, found.shares, strict=True)
    answer: JsonObject = {
        "folder": str(found.folder),
        "points": [_point_json(point) for point in found.points],
        "modes": [mode_json(shape.mode) | _shape_json(shape, rows) for shape, rows in shares],
        "mac": {"frequency_hz": _list_frequencies(found), "values": found.auto_mac},
        "checks": [pick(check, "point", "kind", "frac", "scale", "is_passed") for check in found.checks],
        "remarks": found.remarks,
    }
    if reference is not None:
        names, values = compare_shapes(found, reference)
        frequencies = {"frequency_hz": _list_frequencies(found), "reference_hz": _list_frequencies(reference)}
        answer["against"] = {"folder": str(reference.folder), "points": names, **frequencies, "mac": values}
    return answer


def _point_json(point: MeasuredPoint) -> JsonObject:
    return {"name": point.name, "position_m": point.position, **pick(point, "part", "count")}


def _shape_json(shape: ModeShape, shares: Sequence[PartShare]) -> JsonObject:
    motion, normalized = shape.motion, shape.mass_normalized
    return {
        "shape": {"real": motion.real, "imag": motion.imag, "std": shape.motion_error},
        "mass_normalized_shape": {"real": normalized.real, "imag": normalized.imag},
        "phase_collinearity": shape.phase_collinearity,
        "mean_phase_deviation_deg": shape.mean_phase_deviation_deg,
        "shares": [{"parts": row.parts, "share": row.share, "share_std": row.standard_error} for row in shares],
    }


def _list_frequencies(found: FolderShapes) -> list[float]:
    return [found.shapes[i].mode.frequency for i in found.accepted]


def folder_shapes_texts(
    found: FolderShapes, reference: FolderShapes | None = None, *, everything: bool = False
) -> Texts:
    """Return the mode shapes of a folder in words; everything: rejected modes and each single remark, too."""
    shown = range(len(found.shapes)) if everything else found.accepted
    shapes, shares = [found.shapes[i] for i in shown], [found.shares[i] for i in shown]
    modes, headings = [shape.mode for shape in shapes], [f"{shape.mode.frequency:.1f} Hz" for shape in shapes]
    n, parts = sum(point.count for point in found.points), Counter(point.part for point in found.points)
    by_part = ", ".join(f"{part} {count}" for part, count in parts.items())
    remarks = mode_remark_lines if everything else grouped_remark_lines
    texts: Texts = [
        f"{found.folder.name}: {count_noun(len(found.points), 'point')} ({by_part}), {count_noun(n, 'measurement')}",
        mode_table(modes),
        count_by_trust([shape.mode for shape in found.shapes])
        + ("" if everything else " (all modes and remarks: --all)"),
    ]
    if shapes:
        texts += ["motion over that of the tip", _shape_table(found.points, shapes, headings)]
        if len(shares[0]) > 1:
            texts += ["share of the compliance 1/K at the tip (%)", _share_table(shares, headings)]
        texts += ["MAC of the modes", _mac_table(_list_frequencies(found), _list_headings(found), found.auto_mac)]
    if reference is not None:
        names, values = compare_shapes(found, reference)
        texts.append(f"MAC with {reference.folder.name} over {count_noun(len(names), 'point')}")
        texts.append(_mac_table(_list_frequencies(found), _list_headings(reference), values))
    texts += [_check_table(found.checks)] if found.checks else []
    return [*texts, *remarks(modes, found.remarks)]


def _list_headings(found: FolderShapes) -> list[str]:
    """Return the frequencies of the accepted modes as headings of a table."""
    return [f"{frequency:.1f} Hz" for frequency in _list_frequencies(found)]


def _shape_table(points: Sequence[MeasuredPoint], shapes: Sequence[ModeShape], headings: Sequence[str]) -> Table:
    """Return the real part of each motion, and the phase figures of each mode."""
    table = new_table("<point", "mm", "<part", *headings)
    for place, point in enumerate(points):
        motions = (f"{shape.motion[place].real:+.3f}" for shape in shapes)
        table.add_row(point.name, f"{point.position * 1e3:g}", point.part, *motions)
    table.add_row("MPC", "", "", *(f"{shape.phase_collinearity:.2f}" for shape in shapes))
    table.add_row("phases (deg)", "", "", *(f"±{shape.mean_phase_deviation_deg:.1f}" for shape in shapes))
    return table


def _share_table(shares: Sequence[Sequence[PartShare]], headings: Sequence[str]) -> Table:
    cells = [
        [" + ".join(rows[0].parts), *(format_with_error(row.share, row.standard_error, 0.01) for row in rows)]
        for rows in zip(*shares, strict=True)
    ]
    return new_table("<part", *headings, rows=cells)


def _mac_table(frequencies: Sequence[float], headings: Sequence[str], values: Floats) -> Table:
    rows = ([f"{f:.1f} Hz", *(f"{value:.2f}" for value in row)] for f, row in zip(frequencies, values, strict=True))
    return new_table("<", *headings, rows=rows)


def _check_table(checks: Sequence[PointCheck]) -> Table:
    rows = (
        (check.point, check.kind, f"{check.frac:.3f}", f"{check.scale:+.3f}", "passed" if check.is_passed else "failed")
        for check in checks
    )
    return new_table("<point", "<check", "FRAC", "size ratio", "<result", rows=rows)
