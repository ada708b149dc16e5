"""The modes of stored tap tests, and what a person says of them."""

from __future__ import annotations

from collections.abc import Sequence

from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.replaying.of_files import of_files
from lobewatch.machine.journal.exclusion import find_excludable
from lobewatch.measuring import FileModes, modes_of_file
from modal import ModeEdits


def modes_of_tap(logbook: Logbook, name: str, edits: ModeEdits | None = None) -> FileModes:
    """Modes of a tap test; name: its identity, file, or a part that no other has.

    edits: kept for it from now on in place of what was said before; None: nothing changes. ValueError, and nothing is
    kept, where they cannot be done; DataError where its file is damaged.
    """
    entries = [*logbook.files.by_id.values()]
    tap = find_excludable(name, entries, (), str(logbook.folder.path))
    if edits is not None:
        reasons = logbook.choose_modes([tap.id], edits)
        if reasons:
            raise ValueError(f"{reasons[tap.id]}; nothing is kept")
    now = logbook.files.by_id[tap.id]
    logbook.folder.read(now)
    return modes_of_file(logbook.folder.path / now.file, by_hand=now.by_hand, sensor=logbook.machine.tap.sensor)


def choice_of(edits: ModeEdits, by_fit: bool) -> ModeEdits | None:
    """Edits to be kept, empty ones where all is taken back; None where nothing changes. ValueError for both."""
    if edits and by_fit:
        raise ValueError("--by-fit takes back all that is said by hand; leave --add, --drop and --fix out")
    return edits if edits or by_fit else None


def keep_edits(logbook: Logbook, tap_ids: Sequence[str], edits: ModeEdits) -> str:
    """Keep what is said of the modes of these tap tests, if anything; a text on those that it cannot be done of."""
    reasons = logbook.choose_modes(tap_ids, edits) if edits else {}
    return "\n".join(["stored without:", *of_files(reasons.items())]) if reasons else ""


def refuse_edits(edits: ModeEdits) -> None:
    """ValueError where something is said of modes though nothing is stored."""
    if edits:
        raise ValueError(f"{edits}: with --dry-run nothing is kept; lobewatch modes FILE shows what becomes of it")
