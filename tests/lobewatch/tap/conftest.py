"""Fixtures of the live tap test."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from acquisition import Block, Channel, Circumstances, DeviceError, HammeredStructure, SimulatedSource
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState

RATE = 25600.0


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    return MachineFolder(tmp_path / "m")


@pytest.fixture
def open_folder(folder: MachineFolder) -> MachineFolder:
    """Return a machine folder that leaves trigger level and record length to trial hits."""
    text = folder.toml.read_text("utf-8")
    folder.toml.write_text(re.sub(r"^(record_s|trigger_n) .*\n", "", text, flags=re.MULTILINE), "utf-8")
    return MachineFolder(folder.path)


class Simulated(SimulatedSource):
    """Device without a cable. Before each block it checks whether it is unplugged or its samples end."""

    def __init__(
        self,
        signal: HammeredStructure,
        channels: tuple[Channel, ...],
        seconds: float = 60.0,
        *,
        unplugged: Callable[[], bool] = bool,
        ended: Callable[[], bool] = bool,
        fault: Callable[[], str] = str,
    ) -> None:
        super().__init__(signal, channels, RATE, round(seconds * RATE))
        self._unplugged, self._ended, self._fault = unplugged, ended, fault

    @property
    def fault(self) -> str:
        return self._fault()

    def blocks(self) -> Iterator[Block]:
        for block in super().blocks():
            if self._unplugged():
                raise DeviceError("the DAQ on /dev/x was unplugged", "plug it in and repeat the command")
            if self._ended():
                return
            yield block

    def close(self) -> None: ...


@pytest.fixture
def simulated() -> type[Simulated]:
    """Return a function that makes a device without a cable."""
    return Simulated


@pytest.fixture
def session_of() -> Callable[..., TapSession]:
    """Return a function that makes a session which passes each new state to a callback, through its clock."""

    def make(
        folder: MachineFolder,
        open_device: Callable[[], Any],
        watch: Callable[[TapState], None] = lambda _: None,
        **options: Any,
    ) -> TapSession:
        about = Circumstances("m", datetime.now(UTC), "reference", machine_toml=folder.toml.read_text("utf-8"))
        made: list[TapSession] = []

        def clock() -> float:
            if made:
                watch(made[0].state)
            return time.monotonic()

        made.append(TapSession(folder, open_device, about, clock=clock, sleep=lambda _: None, **options))
        return made[0]

    return make
