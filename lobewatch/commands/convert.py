"""lobewatch convert."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from lobewatch.commands.file_options import (
    Averages,
    Columns,
    ForceUnit,
    FullScale,
    Quantity,
    Rate,
    Response,
    Sensitivity,
    Unit,
    described,
)
from lobewatch.show.terminal.output import Json, emit


def convert(
    file: Annotated[Path, typer.Argument(help="Recorded hits or an FRF, as for lobewatch modes.")],
    out: Annotated[Path, typer.Argument(help="What to write: .uff (.unv), .csv, .mat, or .json (SEP005, hits only).")],
    hits: Annotated[bool, typer.Option("--hits", help="The signals over time instead of the FRF.")] = False,
    columns: Columns = "",
    quantity: Quantity = "",
    unit: Unit = "",
    force_unit: ForceUnit = "",
    rate: Rate = None,
    averages: Averages = None,
    response: Response = None,
    full_scale: FullScale = "",
    sensitivity: Sensitivity = "",
    date: Annotated[datetime | None, typer.Option(help="When it was recorded, where the file does not say.")] = None,
    direction: Annotated[str, typer.Option(help="Direction at the tool tip, where the file does not say.")] = "",
    as_json: Json = False,
) -> None:
    """A recorded file written for other programs: universal file, text table, MATLAB, SEP005.

    With frequency lines, FRF, coherence, averages, units, direction and date, in SI units; what is written is read
    back as the same.

    Examples:

      lobewatch convert mill-3/taps/ID.h5 tap.uff
      lobewatch convert hit.lvm hit.json --hits
      lobewatch convert h.mat h.csv --unit g/N --response 2
    """
    from acquisition import convert as write
    from lobewatch.show.replays.describe_preview import fact_lines

    said = described(
        columns,
        full_scale,
        sensitivity,
        quantity=quantity,
        unit=unit,
        force_unit=force_unit,
        rate=rate,
        averages=averages,
        response=response,
        date=date,
        direction=direction,
    )
    made = write(file, out, said, hits=hits)
    payload = {
        "file": str(made.path),
        "format": made.title,
        "holds": made.what,
        "precision": made.precision,
        "facts": [{"name": one.name, "value": one.value, "origin": one.origin} for one in made.recording.facts],
    }
    told = fact_lines(made.recording.facts)
    emit(payload, as_json, f"{made.path}: {made.title}, {made.what}, {made.precision}", *told)
