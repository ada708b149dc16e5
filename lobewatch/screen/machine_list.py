"""What the dashboard asks for every few seconds: all machines, or that nothing has changed."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import msgspec

from lobewatch.machine.folder import MachineFolder
from lobewatch.plant.plant import MachineStanding, Plant
from lobewatch.show.plant.plant_rows import plant_row
from lobewatch.tap.spool import interrupted_tests


def machine_list(plant: Plant, running: Collection[str], may_alter: bool, known: str) -> bytes:
    """The answer as JSON; running: machines that a test runs on; known: version that the page shows already."""
    machines = [_row(one) | {"running": one.key in running} for one in plant.standings()]
    body = msgspec.json.encode({"machines": machines, "may_alter": may_alter})
    version = hashlib.sha256(body).hexdigest()[:16]
    if version == known:
        return msgspec.json.encode({"version": version})
    return msgspec.json.encode({"version": version, "machines": machines, "may_alter": may_alter})


def _row(one: MachineStanding) -> dict[str, Any]:
    """Days to a tenth, rounded down: what changes with every look would be sent with every look."""
    row = plant_row(one)
    left = row["days_left"]
    row["days_left"] = left if left is None else math.floor(10 * left) / 10
    return row | {"interrupted": _interrupted(one.path)}


def _interrupted(path: Path) -> dict[str, int]:
    try:
        spool = path / "spool"
        is_empty = not spool.is_dir() or not any(one.is_dir() for one in spool.iterdir())
        return {} if is_empty else interrupted_tests(MachineFolder(path))
    except (OSError, ValueError):
        return {}  # the row says what is wrong
