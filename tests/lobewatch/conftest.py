"""Fixtures that several tests of the application share."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import (
    UNKNOWN_CONDITIONS,
    Circumstances,
    Conditions,
    TapDirection,
    TapTest,
    from_accelerance,
    new_tap_id,
)
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.folder_updates import ObservedWord, make_observed_cut, store_cut
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.settings.requested_cut import find_cut_setting
from modal import Mode, synthesize_frf

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
LINES = np.arange(4.0, 4000.0, 4.0)
SLOT = """
[[program]]
name = "{name}"
tool = "{tool}"
teeth = 4
tool_diameter_mm = 20
radial_depth_mm = 20
direction = "down"
tangential_n_per_mm2 = 1400
radial_n_per_mm2 = 500
speed_rpm = {speed:g}
depth_mm = {depth:g}
{more}
"""


class Shop:
    """Example machine in a folder "m", with tap tests on demand."""

    start = START

    def __init__(self, path: Path) -> None:
        """Create a machine with the example programs, without a tap test."""
        make_machine_folder(path, "surrogate_machine.toml")
        self.path = path

    @property
    def folder(self) -> MachineFolder:
        """Machine folder as it is now."""
        return MachineFolder(self.path)

    @property
    def logbook(self) -> Logbook:
        """Logbook as it is now."""
        return Logbook.open(self.path)

    def edit(self, old: str, new: str) -> None:
        """Replace all of a text in machine.toml."""
        toml = self.path / "machine.toml"
        text = toml.read_text("utf-8")
        assert old in text
        toml.write_text(text.replace(old, new), "utf-8")

    def run(self, *programs: tuple[str, float, float], tool: str = "reference", more: str = "") -> None:
        """Run these slots (name, rpm, mm) and no others."""
        slots = (SLOT.format(name=n, tool=tool, speed=speed, depth=depth, more=more) for n, speed, depth in programs)
        self.put("".join(slots))

    def put(self, programs: str) -> None:
        """Replace the programs."""
        text = (self.path / "machine.toml").read_text("utf-8")
        end = text.index("# The spindle of the example")
        self.edit(text[text.index("[[program]]") : end], f"{programs.strip()}\n\n")

    def run_safe_slots(self) -> None:
        """All stable with x at 1713 Hz and y at 1690 Hz; A and C chatter when both have fallen by 10 %."""
        self.run(("A", 12900, 1.5), ("B", 8700, 0.4), ("C", 6500, 1.0))

    def tap(
        self,
        days: float,
        frequency: float,
        direction: TapDirection = "x",
        *,
        tool: str = "reference",
        stiffness: float = 3.5e7,
        damping_ratio: float = 0.029136,
        conditions: Conditions = UNKNOWN_CONDITIONS,
        operator: str = "",
    ) -> str:
        """Store a noise-free tap test so many days after the start, and return its id."""
        when = START + timedelta(days=days)
        text = (self.path / "machine.toml").read_text("utf-8")
        about = Circumstances("m", when, tool, direction, operator, text, conditions=conditions)
        frf = synthesize_frf([Mode(frequency, damping_ratio, stiffness)], LINES)
        tap = TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance))
        self.folder.commit(tap)
        return tap.id

    def tap_both(self, days: float = 0.0, share: float = 1.0) -> None:
        """Both directions; share: of the frequency of the new spindle."""
        self.tap(days, 1713.0 * share)
        self.tap(days + 0.1, 1690.0 * share, "y")

    def hear(self, speed: float, depth_mm: float, word: ObservedWord, frequency: float | None = None) -> CutEntry:
        """Store a test cut of program A one day after the start."""
        setting = find_cut_setting(self.folder.machine, "A", speed, depth_mm)
        return store_cut(self.folder, make_observed_cut(setting, word, frequency, at=START + timedelta(days=1)))


@pytest.fixture(scope="session")
def new_shop() -> type[Shop]:
    """For what several tests of a file look at."""
    return Shop


@pytest.fixture
def shop(tmp_path: Path) -> Shop:
    """Return a machine that runs the safe slots and is not tapped yet."""
    found = Shop(tmp_path / "m")
    found.edit("high_rpm = 24000", "high_rpm = 24000\nsteps = 200\ndrop_percent = [0, 0]")
    found.run_safe_slots()
    return found
