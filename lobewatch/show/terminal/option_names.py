"""Command-line names for the fields and functions that messages of the library name.

The library does not know the command line: its errors and remarks name a field (`Description.unit`) or a function
(`Logbook.verdicts`). A person at the terminal, and a program that reads the JSON, needs the option or the command.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

OPTION_NAMES: Mapping[str, str] = {
    # acquisition.files
    "Description.averages": "--averages",
    "Description.columns": "--columns",
    "Description.decimal": "--decimal",
    "Description.force": "--force",
    "Description.force_unit": "--force-unit",
    "Description.full_scale": "--full-scale",
    "Description.pulses": "--pulses",
    "Description.quantity": "--quantity",
    "Description.rate": "--rate",
    "Description.response": "--response",
    "Description.sensitivity": "--sensitivity",
    "Description.sensor": "--sensor",
    "Description.skip": "--skip",
    "Description.spacing": "--spacing",
    "Description.start": "--start",
    "Description.tacho": "--tacho",
    "Description.unit": "--unit",
}
"""Option or command for each field or function that a message names."""

_NAMES = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(OPTION_NAMES, key=len, reverse=True)))})\b")


def with_option_names(text: str) -> str:
    """Replace the library fields and functions that a message names by their options and commands."""
    return _NAMES.sub(lambda match: OPTION_NAMES[match[0]], text)
