"""Numbers of machine.toml that a person says are right, kept there: [machine] accepted."""

from __future__ import annotations

from collections.abc import Sequence

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.new_folder import write_machine
from lobewatch.machine.settings.edit_text import TablePlace, edit_text
from lobewatch.machine.settings.plausible import Doubted
from lobewatch.machine.settings.setting_questions import all_questions, guessed_bearings


def accept_settings(folder: MachineFolder, keys: Sequence[str]) -> list[str]:
    """Write down that what is asked about these keys is right; the lines that are written.

    A key, or a whole line where several tables ask about it. ValueError, and nothing is written, for what is not asked.
    """
    asked = setting_questions(folder)
    accepted = list[str]()
    for key in keys:
        claims = [doubted.claim for doubted in asked if key in (doubted.key, doubted.claim)]
        if not claims:
            listed = "; ".join(doubted.claim for doubted in asked) or "none"
            raise ValueError(f"--accept {key}: nothing is asked about it; open questions: {listed}")
        accepted += claims
    lines = [*folder.machine.machine.accepted, *dict.fromkeys(accepted)]
    write_machine(folder.path, edit_text(folder.toml_text, TablePlace("machine"), {"accepted": lines}))
    return accepted


def setting_questions(folder: MachineFolder) -> list[Doubted]:
    """All that machine.toml is asked about."""
    guessed = guessed_bearings(folder.machine)
    return [*all_questions(folder.machine), *([guessed] if guessed else [])]
