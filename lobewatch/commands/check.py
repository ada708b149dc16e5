"""lobewatch check."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from acquisition import DataError
from lobewatch.analysis.advice import ProgramAdvice, advise
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.machine_file import SpeedRange
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.describe_lobes import limit_text, margin_text
from lobewatch.show.output import Json, emit, notes, table


def check(
    machine: Annotated[
        Path, typer.Argument(parser=named_folder, help="Machine folder with tap tests and cutting programs.")
    ],
    as_json: Json = False,
) -> None:
    """Every cutting program against the newest tap test with its tool; exit code 1 unless all are stable.

    By semi-discretisation. A program that could not be checked does not count as stable. The decay column says how far
    f_n may fall before the program chatters.

    Examples:

      lobewatch check trial

      lobewatch check trial --json
    """
    folder = MachineFolder(machine)
    if not folder.machine.program:
        raise DataError(f"{folder.toml}: no [[program]] to check; add one for each cut that the shop runs")
    if not folder.taps():
        raise DataError(f"{folder.path}: no tap test yet; take one with lobewatch tap, or replay a recorded file")
    advice = advise(folder, notes.print)
    unstable = sum(one.check is not None and not one.check.stable for one in advice)
    checked = sum(one.check is not None for one in advice)
    missing = len(advice) - checked
    emit(
        {"programs": [_json(one) for one in advice], "unstable": unstable, "not_checked": missing},
        as_json,
        _table(advice),
        *(line for one in advice for line in _sentences(one, folder.machine.speed)),
        *_notes(advice),
        f"{unstable} of {checked} programs not stable"
        + (f", {missing} of {len(advice)} not checked" if missing else ""),
    )
    if unstable or missing:
        raise typer.Exit(1)


def _notes(advice: Sequence[ProgramAdvice]) -> Iterator[str]:
    """Each note once, with the programs that it is about where it is not about all."""
    about: dict[str, list[str]] = {}
    for one in advice:
        for note in one.notes:
            about.setdefault(note, []).append(one.table.name)
    for note, names in about.items():
        yield f"note: {note}" if len(names) == len(advice) else f"note: {', '.join(names)}: {note}"


def _json(one: ProgramAdvice) -> dict[str, Any]:
    found = one.check
    known: dict[str, Any] = {"stable": None}
    if found is not None:
        known = {
            "stable": found.stable,
            "measured": one.measured,
            "was_stable_at_first": one.was_stable,
            "limit_mm": found.limit * 1e3,
            "limit_low_mm": one.limit_band[0] * 1e3,
            "limit_high_mm": one.limit_band[1] * 1e3,
            "depth_margin": found.depth_margin,
            "nearest_speed_rpm": found.nearest_speed,
            "speed_margin": found.speed_margin,
            "chatter_frequency_hz": found.chatter_frequency,
            "kind": found.kind,
            "tolerable_decay": one.decay,
            "drive_limit_mm": one.drive_limit * 1e3,
            "method": found.method,
            "method_detail": found.detail,
        }
    about = {"name": one.table.name, "speed_rpm": one.table.speed_rpm, "depth_mm": one.table.depth_mm}
    return about | {"tap_id": one.tap_id} | known | {"notes": list(one.notes)}


def _table(advice: Sequence[ProgramAdvice]) -> Table:
    made = table("<program", "speed (rpm)", "depth (mm)", "limit (mm), 95 %", "margin", "decay left", "<verdict")
    for one in advice:
        row = [escape(one.table.name), f"{one.table.speed_rpm:g}", f"{one.table.depth_mm:g}"]
        made.add_row(*row, *_verdict(one))
    return made


def _verdict(one: ProgramAdvice) -> tuple[str, str, str, str]:
    found = one.check
    if found is None:
        return "-", "-", "-", "not checked"
    low, high = (edge * 1e3 for edge in one.limit_band)
    limit, margin = limit_text(found, one.table.depth_mm), margin_text(found)
    if one.measured and math.isfinite(found.limit):
        limit += f" ({low:.2f}..{high:.2f})"
    beyond = one.table.depth_mm > one.drive_limit * 1e3
    predicted = "" if one.measured else " (predicted)"
    if not found.stable:
        verdict = f"NOT STABLE{' any more' if one.was_stable else ''}{', beyond the drive' if beyond else ''}"
        return limit, margin, "none", verdict + predicted
    left = "> 20 %" if math.isinf(one.decay) else f"{100 * one.decay:.1f} %"
    verdict = "beyond the drive" if beyond else f"stable{', within the error' if low <= one.table.depth_mm else ''}"
    return limit, margin, left, verdict + predicted


def _sentences(one: ProgramAdvice, speeds: SpeedRange) -> Iterator[str]:
    """What to do, a line for each program that calls for something."""
    found, name = one.check, one.table.name
    if found is None:
        return
    if not found.stable:
        word = "period-two chatter" if found.kind == "flip" else "chatter"
        yield (
            f"{name}: {word} near {found.chatter_frequency:.0f} Hz; at this speed cut no deeper than "
            f"{found.limit * 1e3:.2f} mm, or {_elsewhere(one, speeds)}"
        )
    elif found.nearest_speed is not None and found.speed_margin < 0.03:
        yield (
            f"{name}: only {100 * found.speed_margin:.1f} % of speed from chatter, which begins at "
            f"{found.nearest_speed:.0f} rpm"
        )
    if one.table.depth_mm > one.drive_limit * 1e3:
        yield f"{name}: [drive] allows no more than {one.drive_limit * 1e3:.2f} mm at this speed"


def _elsewhere(one: ProgramAdvice, speeds: SpeedRange) -> str:
    found = one.check
    if found is None or found.nearest_speed is None:
        drive = " that [drive] allows" if math.isfinite(one.drive_limit) else ""
        return (
            f"choose another tool: no stable speed{drive} at this depth in {speeds.low_rpm:g}..{speeds.high_rpm:g} rpm"
        )
    return f"run this depth at {found.nearest_speed:.0f} rpm, the nearest stable speed"
