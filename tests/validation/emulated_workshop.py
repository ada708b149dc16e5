"""Random machines in folders, tapped through emulated boards: the bytes of the board are all that the program sees."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from emulated_board import (
    RATE,
    RIGHT,
    Tapped,
    Truth,
    Wrong,
    choose_sensors,
    modes_of,
    random_truth,
    run_session,
    scale,
    serve,
    spread,
)

from acquisition import (
    Channel,
    Circumstances,
    MeasuredRate,
    TapDirection,
)
from lobes import Cut, Direction, Program, program_limit
from lobewatch.logbook import Logbook
from lobewatch.machine.daq_rates import replace_stored_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.emulated_mass import build_hung_mass
from lobewatch.tap.mass_check import measure_mass, store_mass_result
from lobewatch.tap.session import TapSession
from lobewatch.verdicts import Stability

START = datetime(2025, 1, 15, 9, tzinfo=UTC)
MONTH = timedelta(days=30)
MONTHS = 60
"""Months of a machine."""
HITS = 4
"""Good hits of a test."""
TOML = """
[machine]
name = "m"
{interval}
[tap]
tool = "cutter"
hits = {hits}
pre_trigger_s = 0.02
sensor_mass_g = 0
mounting = "glue"
[speed]
low_rpm = 1000
high_rpm = 24000
[reference_cut]
teeth = {teeth}
tool_diameter_mm = {diameter:.3f}
radial_depth_mm = {diameter:.3f}
direction = "down"
tangential_n_per_mm2 = {tangential:.0f}
radial_n_per_mm2 = {radial:.0f}
"""
TOOL = """
[[tool]]
name = "cutter"
diameter_mm = {diameter:.3f}
stick_out_mm = {stick_out:.3f}
tool_material = "carbide"
"""
PROGRAM = """
[[program]]
name = "{name}"
tool = "cutter"
teeth = {teeth}
tool_diameter_mm = {diameter:.3f}
radial_depth_mm = {radial_depth:.3f}
direction = "{direction}"
tangential_n_per_mm2 = {tangential:.0f}
radial_n_per_mm2 = {radial:.0f}
speed_rpm = {speed:.0f}
depth_mm = {depth:.4f}
"""
PROGRAMS = {"half": 0.5, "just": 1.03}
"""Programs and their depths over the true limit."""
DIRECTIONS: tuple[Direction, Direction] = ("up", "down")
FEED_ANGLES = np.pi * np.arange(12) / 12


@dataclass
class Workshop:
    """Machine with its folder, its truth and its sensors."""

    path: Path
    rng: np.random.Generator
    stiffness_std: float = 0.03
    knows_tool: bool = True
    truth: Truth = field(init=False)
    channels: tuple[Channel, Channel] = field(init=False)
    clamped: list[tuple[float, float]] = field(init=False)
    """Frequency in each month over the first one, and bias of ln K of its operator."""
    month: int = 0
    ratio: float = 1.0
    """Kt and Kr as entered, over the true ones."""
    interval: int | None = None
    """Agreed interval of tap tests as entered (days)."""

    def __post_init__(self) -> None:
        """Draw the machine and make its folder."""
        rng = self.rng
        self.truth = random_truth(rng)
        self.channels = choose_sensors(self.truth.x, rng)
        operators = 0.5 * self.stiffness_std * rng.standard_normal(3)
        worn, reclamping = 1 - rng.uniform(0, 0.002) * np.arange(MONTHS), spread(rng, 5e-4, 3e-3)
        self.clamped = [
            *zip(worn * np.exp(reclamping * rng.standard_normal(MONTHS)), rng.choice(operators, MONTHS), strict=True)
        ]
        make_machine_folder(self.path, "new_machine.toml")
        self.cut, self.speed = self._draw_cut(), float(np.exp(rng.uniform(np.log(2500), np.log(20000))))
        self.write()

    def _draw_cut(self) -> Cut:
        tangential = self.rng.uniform(500e6, 2200e6)
        immersion, direction = self.rng.choice([1.0, 0.5, 0.15]), DIRECTIONS[self.rng.integers(2)]
        radial = tangential * self.rng.uniform(0.2, 0.5)
        return Cut(int(self.rng.integers(2, 6)), immersion, direction, tangential, radial)

    @property
    def folder(self) -> MachineFolder:
        """Folder as it is now."""
        return MachineFolder(self.path)

    @property
    def time(self) -> datetime:
        """Time of the next tap test."""
        return START + self.month * MONTH

    def copy(self, path: Path, seed: int) -> Workshop:
        """Return the machine in a copy of its folder elsewhere, with chance of its own."""
        shutil.copytree(self.path, path)
        other = object.__new__(Workshop)
        other.__dict__.update(self.__dict__, path=path, rng=np.random.default_rng(seed))
        return other

    def limit(self, truth: Truth, speed: float) -> float:
        """Return the true limit at a speed, fed in the worst direction (m)."""
        cuts = [replace(self.cut, feed_angle=float(angle)) for angle in FEED_ANGLES]
        program = Program(self.cut, speed, 2e-4)
        limits = program_limit(program, modes_of(truth.x), modes_of(truth.y), cuts).limits
        return float(min(*limits, 20e-3))

    def write(self, *programs: str) -> None:
        """Write machine.toml with some of PROGRAMS. Without them, the history computes no verdicts."""
        diameter = 1e3 * self.truth.beam.diameter
        cut = {
            "teeth": self.cut.teeth,
            "diameter": diameter,
            "tangential": self.cut.tangential / 1e6 * self.ratio,
            "radial": self.cut.radial / 1e6 * self.ratio,
        }
        interval = f"tap_interval_days = {self.interval}" if self.interval else ""
        text = TOML.format(hits=HITS, interval=interval, **cut)
        if self.knows_tool:
            text += TOOL.format(diameter=diameter, stick_out=1e3 * self.truth.beam.stick_out)
        more = {"radial_depth": self.cut.immersion * cut["diameter"], "direction": self.cut.direction}
        for name in programs:
            depth = 1e3 * PROGRAMS[name] * self.limit(self.truth, self.speed)
            text += PROGRAM.format(**cut, **more, name=name, speed=self.speed, depth=depth)
        (self.path / "machine.toml").write_text(text, "utf-8")

    def tap_both(self, wrong: Wrong = RIGHT, only: Sequence[TapDirection] = ("x", "y")) -> frozenset[str]:
        """Tap x and y of a month, and return the codes."""
        found = [self.tap(direction, wrong).codes for direction in only]
        self.month += 1
        return frozenset().union(*found)

    def tap(self, direction: TapDirection, wrong: Wrong = RIGHT) -> Tapped:
        """Make one tap test through the bytes of a board."""
        reclamped, operator = self.clamped[self.month]
        scatter = operator + math.sqrt(0.75) * self.stiffness_std * self.rng.standard_normal()
        truth = wrong.structure or self.truth.of(direction)
        structure = scale(truth, reclamped, reclamped**2 * np.exp(scatter))
        created = wrong.created or self.time + (direction == "y") * timedelta(minutes=20)
        about = Circumstances("m", created, wrong.tool, direction, "operator", self.folder.toml_text)
        with serve(self, structure, wrong) as (open_device, watch):
            session = TapSession(self.folder, open_device, about, guided=wrong.guided, resume=False)
            watch(session)
            return run_session(session, self.path)

    def check_mass(self, mass: float = 1.0, entered: float = 1.0, wrong: Wrong = RIGHT) -> None:
        """Hit a hung mass (kg) and store the result."""
        folder = self.folder
        with serve(self, build_hung_mass(mass), wrong) as (open_device, _), folder.locked(), open_device() as device:
            result = measure_mass(folder, device, entered, lambda _: None)
            store_mass_result(folder, device, result, "operator", self.time - timedelta(days=1))

    def know_rate(self) -> None:
        """Store the stated sample rate as measured earlier."""
        right, folder = Wrong(rate_ratio=1.0), self.folder
        with serve(self, self.truth.x, right) as (open_device, _), folder.locked(), open_device() as device:
            replace_stored_rate(folder, device, MeasuredRate(RATE, 0.5, 128_000, 5.0))


class Said(NamedTuple):
    """Outputs of the program on a machine."""

    check: frozenset[str]
    """Codes of the remarks on its programs."""
    status: frozenset[str]
    """Codes of its status."""
    stable: frozenset[float]
    """Depths of the programs called stable, over their true limits."""
    level: str
    """Status."""


def ask(shop: Workshop, now: datetime) -> Said:
    """Return what `check` and `status` say at a time."""
    logbook = Logbook.open(shop.path, now)
    verdicts, status = logbook.verdicts(), logbook.status(now)
    stable = frozenset(PROGRAMS[v.program.name] for v in verdicts if v.stability is Stability.STABLE)
    check = frozenset(remark.code for verdict in verdicts for remark in verdict.remarks)
    reasons = frozenset(remark.code for remark in (*status.remarks, *logbook.remarks))
    return Said(check, reasons, stable, str(status.status))
