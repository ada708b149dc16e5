"""Command `lobewatch verify`: verify the files of a machine folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_files import to_folder_path
from lobewatch.show.terminal.output import Json, emit


def verify(
    machine: Annotated[Path, typer.Argument(parser=to_folder_path, help="Machine folder.")],
    as_json: Json = False,
) -> None:
    """Verify every byte of a machine folder.

    Names every file that is altered, missing, extra, swapped, renamed or cut short, and what to do. A machine.toml that
    was edited is told, and is no damage. Nothing is changed, but that a tap test which an ended program had stored and
    not yet entered in the journal is entered.

    Examples
    --------
      lobewatch verify mill-3
    """
    from lobewatch.machine.verify_files import DAMAGE_CODES
    from lobewatch.machine.verify_files import verify as verify_folder

    verification = verify_folder(machine)
    notes = [remark for remark in verification.remarks if remark.code not in DAMAGE_CODES]
    payload = {
        "damage": list(verification.damage),
        "remarks": list(notes),
        "adopted": verification.entered,
        "sound_taps": verification.n_taps,
    }
    texts = [*(f"damaged: {remark}" for remark in verification.damage), *(f"note: {remark}" for remark in notes)]
    texts += [f"entered in the journal: {name}" for name in verification.entered]
    last = f"{len(verification.damage)} damaged" if verification.damage else "nothing is damaged"
    emit(payload, as_json, *texts, f"{verification.n_taps} tap test(s) as they were committed, {last}")
    if verification.damage:
        raise typer.Exit(1)
