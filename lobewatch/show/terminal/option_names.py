"""Command-line names for the fields and functions that messages of the library name.

The library does not know the command line: its errors and remarks name a field (`Description.unit`) or a function
(`Logbook.verdicts`). A person at the terminal, and a program that reads the JSON, needs the option or the command.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

OPTION_NAMES: Mapping[str, str] = {
    "Description.unit": "--unit",
    # modal
    "ModeEdits.add": "--add",
    "ModeEdits.drop": "--drop",
    "ModeEdits.fix": "--fix",
    "modal.synthesize_frf": "lobewatch modes --figure",
    "numpy.conj": "on the command line: --conjugate",
}
"""Option or command for each field or function that a message names."""

_NAMES = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(OPTION_NAMES, key=len, reverse=True)))})\b")


def with_option_names(text: str) -> str:
    """Replace the library fields and functions that a message names by their options and commands."""
    return _NAMES.sub(lambda match: OPTION_NAMES[match[0]], text)
