"""lobewatch replay."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from acquisition import (
    Circumstances,
    DataError,
    Frf,
    SourceFile,
    TapTest,
    average_good,
    new_tap_id,
    read_recording,
    recorded_as,
    tap_direction,
)
from lobewatch.analysis.history import update_history
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.describe import measurement_json, measurement_texts
from lobewatch.show.output import Json, emit, notes


def replay(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    files: Annotated[list[Path], typer.Argument(help="Recorded hits or FRFs: tap file (HDF5), LVM, CSV.")],
    tool: Annotated[
        str, typer.Option(help=r"What was in the spindle; from a tap file, or \[tap] tool, where not given.")
    ] = "",
    direction: Annotated[
        str, typer.Option(help="Direction at the tool tip, x or y; from a tap file, or x, where not given.")
    ] = "",
    date: Annotated[
        datetime | None, typer.Option(help="When it was recorded, local time; from the file where not given.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Recorded files through the same pipeline as a live test; each is stored once.

    All files are read and judged before the first one is stored.

    Examples:

      lobewatch replay mill-3 acceleration.lvm

      lobewatch replay mill-3 2024/*.h5 --tool "shrink-fit 20"
    """
    folder = MachineFolder(machine)
    setup = folder.machine
    with folder.locked():
        stored = {digest: entry.id for entry in folder.taps() for digest in (entry.source_sha256, entry.sha256)}
        fresh: dict[str, TapTest] = {}
        for file in files:
            content = file.read_bytes()
            digest = hashlib.sha256(content).hexdigest()
            if digest in stored or digest in fresh:
                notes.print(f"{file.name}: stored already as {stored.get(digest) or fresh[digest].id}", markup=False)
                continue
            own = recorded_as(file)
            about = replace(
                own,
                machine=setup.machine.name,
                created=date.astimezone() if date else own.created,
                tool=tool or own.tool or setup.tap.tool,
                direction=tap_direction(direction or own.direction),
                machine_toml=folder.toml.read_text("utf-8"),
            )
            fresh[digest] = _tap_test(file, about, SourceFile(file.name, content))
        for recorded in fresh.values():
            folder.commit(recorded)
        _, measurements = update_history(folder)
    new = {recorded.id for recorded in fresh.values()}
    shown = [measurement for measurement in measurements if measurement.tap_id in new]
    texts = [text for m in shown for text in measurement_texts(m, setup)]
    payload = {"measurements": [measurement_json(m, setup) for m in shown]}
    emit(payload, as_json, *texts, f"{len(shown)} of {len(files)} file(s) stored in {folder.path}")


def _tap_test(file: Path, about: Circumstances, source: SourceFile) -> TapTest:
    recording = read_recording(file)
    if isinstance(recording, Frf):
        return TapTest(new_tap_id(about), about, recording, source=source)
    try:
        frf, flags = average_good(recording)
    except DataError as error:
        raise DataError(f"{file}: {error}") from error
    return TapTest(new_tap_id(about), about, frf, tuple(recording), flags, source)
