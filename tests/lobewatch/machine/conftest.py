"""A machine folder with three tap tests, each a few kilobytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import Circumstances, Frf, SourceFile, TapTest, new_tap_id
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
MakeTap = Callable[..., TapTest]


@pytest.fixture
def make_tap() -> MakeTap:
    """Make a tap test a number of days after the start."""

    def make(days: float = 0.0, source: SourceFile | None = None, toml: str = "") -> TapTest:
        about = Circumstances("m", START + timedelta(days=days), "reference", machine_toml=toml)
        frf = Frf(np.arange(1.0, 50.0), np.linspace(1 + 1j, 49 + 49j, 49).astype(np.complex128))
        return replace(TapTest(new_tap_id(about), about, frf, source=source), id=f"tap_{round(days)}")

    return make


@pytest.fixture
def folder(tmp_path: Path, make_tap: MakeTap) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "new_machine.toml")
    found = MachineFolder(tmp_path / "m")
    for day in range(3):
        found.commit(make_tap(day, toml=found.toml.read_text("utf-8")))
    return found
