"""The example machine with one program, and taps of it without noise."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import Circumstances, TapDirection, TapTest, from_accelerance, new_tap_id
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from modal import Mode, synthesize_frf

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
LINES = np.arange(4.0, 4000.0, 4.0)
MODEL = "# The spindle of the example"


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    """Make the example machine with its first program only."""
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    toml = tmp_path / "m" / "machine.toml"
    head, first, *_, last = toml.read_text("utf-8").split("[[program]]")
    toml.write_text(f"{head}[[program]]{first}{last[last.index(MODEL) :]}", "utf-8")
    return edit(MachineFolder(tmp_path / "m"), "high_rpm = 24000", "high_rpm = 24000\nsteps = 300")


def tap(
    folder: MachineFolder, frequency: float, days: float = 0.0, direction: TapDirection = "x", stiffness: float = 3.5e7
) -> None:
    when = START + timedelta(days=days)
    about = Circumstances("m", when, "reference", direction, "", folder.toml.read_text("utf-8"))
    frf = synthesize_frf([Mode(frequency, 0.029136, stiffness)], LINES)
    folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))


def edit(folder: MachineFolder, old: str, new: str) -> MachineFolder:
    text = folder.toml.read_text("utf-8")
    assert old in text
    folder.toml.write_text(text.replace(old, new), "utf-8")
    return MachineFolder(folder.path)
