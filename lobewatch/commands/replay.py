"""lobewatch replay."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit, notes


def replay(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    files: Annotated[list[Path], typer.Argument(help="Recorded hits or FRFs: tap file (HDF5), LVM, CSV.")],
    tool: Annotated[
        str, typer.Option(help="What was in the spindle; from a tap file, or [tap] tool, where not given.")
    ] = "",
    direction: Annotated[
        str, typer.Option(help="Direction at the tool tip, x or y; from a tap file, or x, where not given.")
    ] = "",
    date: Annotated[
        datetime | None, typer.Option(help="When it was recorded, local time; from the file where not given.")
    ] = None,
    accept: Annotated[
        list[str] | None,
        typer.Option(help="Take these recordings though they raise this question, by its code; as often as needed."),
    ] = None,
    temperature: Annotated[float | None, typer.Option(help="Of the spindle then, degC.")] = None,
    note: Annotated[str, typer.Option(help="What else is to be remembered of these tests.")] = "",
    reclamped: Annotated[bool, typer.Option("--reclamped", help="The tool was clamped anew for these tests.")] = False,
    as_json: Json = False,
) -> None:
    """Recorded files through the same pipeline as a live test; each is stored once.

    All files are read and judged before the first one is stored. A recording that is implausible for the machine is
    stored too, and asked about; --accept answers, at once or later: then with the file of the tap test.

    Examples:

      lobewatch replay mill-3 acceleration.lvm
      lobewatch replay mill-3 2024/*.h5 --tool "shrink-fit 20"
      lobewatch replay mill-3 mill-3/taps/ID.h5 --accept frequency-jump
    """
    from acquisition import Conditions
    from lobewatch.analysis import Logbook
    from lobewatch.analysis.questions.accepting import not_asked
    from lobewatch.analysis.questions.asked import checked_codes
    from lobewatch.show.measurements import measurement_json, measurement_texts, program_texts, programs_json

    said = Conditions(temperature_c=temperature, note=note, reclamped=reclamped)
    logbook = Logbook.open(machine)
    codes = checked_codes(accept or ())
    stored = logbook.replay_all(files, date, tool, direction, said)
    unasked = logbook.accept(stored.tap_ids, codes)
    for file, tap_id in stored.known.items():
        notes.print(f"{file.name}: stored already as {tap_id}", markup=False)
    shown = [logbook.measurement(tap_id) for tap_id in stored.fresh]
    texts = [text for m in shown for text in measurement_texts(m, logbook)]
    payload = {
        "measurements": [measurement_json(m, logbook) for m in shown],
        "programs": programs_json(logbook.verdicts()) if shown else [],
        "known": {str(file): tap_id for file, tap_id in stored.known.items()},
    }
    payload |= {"accepted": [code for code in codes if code not in unasked], "questions": logbook.questions}
    texts += [f"accepted: {code}" for code in payload["accepted"]]
    last = f"{len(shown)} of {len(files)} file(s) stored in {logbook.folder.path}"
    emit(payload, as_json, *texts, *(program_texts(logbook) if shown else []), last)
    if unasked:
        raise ValueError(not_asked(unasked, stored.tap_ids, logbook.questions))
