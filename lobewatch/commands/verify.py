"""Command `lobewatch verify`: verify the files of a machine folder."""

import typer

from lobewatch.commands.shared_options import Machine
from lobewatch.show.terminal.output import Json, emit


def verify(machine: Machine, as_json: Json = False) -> None:
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
    damage, n_taps = list(verification.damage), verification.n_taps
    payload = {"damage": damage, "remarks": notes, "adopted": verification.entered, "sound_taps": n_taps}
    texts = [*(f"damaged: {remark}" for remark in damage), *(f"note: {remark}" for remark in notes)]
    texts += [f"entered in the journal: {name}" for name in verification.entered]
    last = f"{len(damage)} damaged" if damage else "nothing is damaged"
    emit(payload, as_json, *texts, f"{n_taps} tap test(s) as they were committed, {last}")
    raise typer.Exit(int(bool(damage)))
