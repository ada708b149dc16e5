"""Command-line names for the fields and functions that messages of the library name.

The library does not know the command line: its errors and remarks name a field (`Description.unit`) or a function
(`Logbook.verdicts`). A person at the terminal, and a program that reads the JSON, needs the option or the command.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

OPTION_NAMES: Mapping[str, str] = {
    "Description.unit": "--unit",
    # acquisition.devices, lobewatch.tap, lobewatch.sensors
    "Description.pulses": "--pulses",
    "Description.sensor": "--sensor",
    "Description.tacho": "--tacho",
    "EmulationSetup.tcp": "--tcp",
    "MountingVariation.bad_share": "--bad-clampings",
    "MountingVariation.scatter": "--scatter",
    "MountingVariation.temperature_swing": "--temperature",
    "ScreenServer.listen": "--listen",
    "acquire_cut.file": "--file",
    "acquire_cut.port": "--port",
    "acquisition.measure_rate": "lobewatch sensors",
    "acquisition.scan_ports": "lobewatch ports",
    "folder_files.make_machine_folder.template": "lobewatch init --example",
    "plan_session.port": "--port",
    "plan_session.resume=False": "--new",
    "record_cut.time_limit": "--seconds",
    "rotate_structure.degrees": "--askew",
    "rotate_structure.direction": "--direction",
    "screen.ScreenServer": "--screen",
}
"""Option or command for each field or function that a message names."""

_NAMES = re.compile(rf"\b(?:{'|'.join(map(re.escape, sorted(OPTION_NAMES, key=len, reverse=True)))})\b")


def with_option_names(text: str) -> str:
    """Replace the library fields and functions that a message names by their options and commands."""
    return _NAMES.sub(lambda match: OPTION_NAMES[match[0]], text)
