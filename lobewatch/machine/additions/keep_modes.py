"""What a person says of the modes of tap tests, written down."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.mode_choice import mode_choice
from modal import ModeEdits


def keep_modes(folder: MachineFolder, tap_ids: Sequence[str], edits: ModeEdits) -> None:
    """A line for each of these tap tests, saved for good when this returns; edits that say nothing take it back."""
    now = datetime.now(UTC)
    if tap_ids:
        with folder.locked():
            folder.journal.append(*(mode_choice(tap_id, edits, now) for tap_id in tap_ids))
