"""A live tap test as machine.toml describes it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

from acquisition import UNSAID, Circumstances, Conditions, tap_direction
from lobewatch.machine import MachineFolder
from lobewatch.tap.plug import Plug
from lobewatch.tap.session import TapSession


def plan_session(
    folder: MachineFolder,
    *,
    port: str = "",
    tool: str = "",
    direction: str = "x",
    operator: str = "",
    resume: bool = True,
    accept: Sequence[str] = (),
    conditions: Conditions = UNSAID,
) -> TapSession:
    """A session of today; what is left empty is taken from machine.toml. ValueError where that names no port either.

    conditions: those of today; what they leave open, machine.toml says too.
    """
    machine = folder.machine
    port = port or machine.daq.port
    if not port:
        raise ValueError(f"no port: give --port, or port in [daq] of {folder.toml}")
    tool = tool or machine.tap.tool
    about = Circumstances(
        machine.machine.name,
        datetime.now(UTC),
        tool,
        tap_direction(direction),
        operator,
        folder.toml.read_text("utf-8"),
        conditions=conditions.over(machine.tap.conditions(tool)),
    )
    return TapSession(folder, Plug(machine.daq, port).open, about, resume=resume, accept=accept)
