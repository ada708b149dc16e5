"""Command `lobewatch convert`: convert a recorded file to another format."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from lobewatch.commands.shared_options import FileOptions, LocalTime, add_file_options, join_hit_files
from lobewatch.show.terminal.output import Json, emit


@add_file_options()
def convert(
    files: Annotated[
        list[Path],
        Argument(help="Recorded hits or FRF, in a format that lobewatch modes reads. With --one-test: several files."),
    ],
    out: Annotated[Path, Argument(help="Output file: .uff, .unv, .csv, .mat, or .json (SEP005, hits only).")],
    hits: Annotated[bool, Option("--hits", help="Write time signals instead of the FRF.")] = False,
    *,
    file_options: FileOptions,
    date: Annotated[datetime | None, LocalTime(help="Recording date. Default: from the file.")] = None,
    direction: Annotated[str, Option(help="Direction at the tool tip. Default: from the file.")] = "",
    as_json: Json = False,
) -> None:
    """Convert a recorded file to another format.

    The output contains frequency lines, FRF, coherence, number of averages, direction and date, in SI units. lobewatch
    reads the output back unchanged.

    Examples
    --------
      lobewatch convert mill-3/taps/ID.h5 tap.uff
      lobewatch convert hit.lvm hit.json --hits
      lobewatch convert hit1.csv hit2.csv hit3.csv hits.uff --hits --one-test
      lobewatch convert h.mat h.csv --unit g/N --response 2
    """
    from acquisition import convert as write
    from lobewatch.show.modes import fact_lines

    said = file_options.description(date=date, direction=direction)
    (file, *more), said = join_hit_files(files, said)
    if more:
        raise ValueError(f"{len(files)} files to convert. Give --one-test for hits of one tap test, or a single file.")
    written = write(file, out, said, hits=hits)
    facts = [{"name": fact.name, "value": fact.value, "origin": fact.origin} for fact in written.recording.facts]
    payload = {"file": str(written.path), "format": written.title, "holds": written.content}
    shown = {"precision": written.precision, "facts": facts, "remarks": written.recording.remarks}
    summary = f"{written.path}: {written.title}, {written.content}, {written.precision}"
    emit(payload | shown, as_json, summary, *fact_lines(written.recording.facts), *map(str, written.recording.remarks))
