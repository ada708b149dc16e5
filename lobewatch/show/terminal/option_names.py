"""Command-line names for the fields and functions that messages of the library name.

The library does not know the command line: its errors and remarks name a field (`Description.unit`) or a function
(`Logbook.verdicts`). A person at the terminal, and a program that reads the JSON, needs the option or the command.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

OPTION_NAMES: Mapping[str, str] = {
    "Description.unit": "--unit",
    # lobewatch.verdicts, cuts, monitoring
    "Circumstances.direction": "--direction",
    "Circumstances.tool": "--tool",
    "Conditions.reclamped": "--reclamped",
    "Logbook.verdicts": "lobewatch check",
    "TapSession.run": "lobewatch tap",
    "add_event.new_baseline": "--new-baseline",
    "folder_updates.add_event": "lobewatch event",
    "folder_updates.exclude_entry": "lobewatch exclude",
    "operator_entries.acknowledge_alarms": "lobewatch ack",
    "pocket_depth.find_pocket_depths": "lobewatch suggest",
    "program_learning.find_next_cut": "lobewatch suggest",
}
"""Option or command for each field or function that a message names."""

_NAMES = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(OPTION_NAMES, key=len, reverse=True)))})\b")


def with_option_names(text: str) -> str:
    """Replace the library fields and functions that a message names by their options and commands."""
    return _NAMES.sub(lambda match: OPTION_NAMES[match[0]], text)
