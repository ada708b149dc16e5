"""Command-line names for the fields and functions that messages of the library name.

The library does not know the command line: its errors and remarks name a field (`Description.unit`) or a function
(`Logbook.verdicts`). A person at the terminal, and a program that reads the JSON, needs the option or the command.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

OPTION_NAMES: Mapping[str, str] = {
    "Description.unit": "--unit",
    # lobewatch.logbook and lobewatch.fleet
    "Description.date": "--date",
    "Description.date_pattern": "--date-pattern",
    "Description.direction": "--direction",
    "DynamicsSource.FRF": "--source frf",
    "DynamicsSource.MODES": "--source modes",
    "ProgramTable.depth_mm": "--depth",
    "ProgramTable.material": "--material",
    "ProgramTable.speed_rpm": "--speed",
    "ProgramTable.tool": "--tool",
    "SeriesStatus.direction": "--direction",
    "SeriesStatus.tool": "--tool",
    "acknowledge_alarms.until": "--until",
    "calibrate_joints.mode": "--mode",
    "calibrate_joints.tools": "--tool",
    "compare_lobes.cut": "--cut",
    "evaluate_requested.names": "--program",
    "fit_file_modes": "lobewatch modes",
    "make_machine_folder": "lobewatch init",
    "store_recordings.keep_going": "--keep-going",
}
"""Option or command for each field or function that a message names."""

_NAMES = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(OPTION_NAMES, key=len, reverse=True)))})\b")


def with_option_names(text: str) -> str:
    """Replace the library fields and functions that a message names by their options and commands."""
    return _NAMES.sub(lambda match: OPTION_NAMES[match[0]], text)


def with_option_names_inside(value: Any) -> Any:
    """Replace the names in all texts of a value made of dicts, lists and texts."""
    if isinstance(value, dict):
        return {key: with_option_names_inside(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [with_option_names_inside(entry) for entry in value]
    return with_option_names(value) if type(value) is str else value
