"""Command `lobewatch verify`: verify the files of a machine folder."""

from collections import Counter

import typer

from lobewatch.commands.shared_options import Machine
from lobewatch.show.terminal.output import Json, count_noun, emit


def verify(machine: Machine, as_json: Json = False) -> None:
    """Verify every byte of a machine folder.

    Lists each altered, missing, extra, swapped, renamed or truncated file with its remedy. An edited machine.toml is
    only noted. A complete tap test of an interrupted program is added to the journal.

    Exit code 1: a file is damaged, a sync program has kept two sides of a file, or a line is not understood.

    Examples
    --------
      lobewatch verify mill-3
    """
    from lobewatch.machine.verify_files import DAMAGE_CODES, name_problem
    from lobewatch.machine.verify_files import verify as verify_folder

    verification = verify_folder(machine)
    notes = [remark for remark in verification.remarks if remark.code not in DAMAGE_CODES]
    damage, n_taps = list(verification.damage), verification.n_taps
    payload = {"damage": damage, "remarks": notes, "adopted": verification.entered, "sound_taps": n_taps}
    texts = [*(f"{name_problem(remark.code)}: {remark}" for remark in damage), *(f"note: {remark}" for remark in notes)]
    texts += [f"added to the journal: {name}" for name in verification.entered]
    problems = Counter(name_problem(remark.code) for remark in damage)
    last = ", ".join(f"{number} {name}" for name, number in problems.items()) or "no damage"
    emit(payload, as_json, *texts, f"{count_noun(n_taps, 'intact tap test')}, {last}")
    raise typer.Exit(int(bool(damage)))
