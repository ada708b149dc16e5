"""Random machines in folders, tapped through emulated boards: the bytes of the board are all that the program sees."""

from __future__ import annotations

import math
import shutil
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition import (
    Block,
    Channel,
    Circumstances,
    DataError,
    Device,
    DeviceError,
    HammeredStructure,
    Hammering,
    MeasuredRate,
    Structure,
    TapDirection,
    TapsEmulator,
    TapsSource,
)
from lobes import Cut, Direction, Program, program_limit
from lobewatch.logbook import Logbook
from lobewatch.machine.daq_rates import replace_stored_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.measurement.tool_compliance import ToolBeam
from lobewatch.tap.emulated_mass import build_hung_mass
from lobewatch.tap.hit_loop import UNFELT_HIT_TEXT, TapStopped
from lobewatch.tap.kept_rate import RATE_FILE_NAME
from lobewatch.tap.mass_check import measure_mass, store_mass_result
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep
from lobewatch.verdicts import Stability
from modal import Mode

Array = NDArray[np.float64]
Disturbance = Callable[[Array, Array], Array]
"""Function of the signals (N and m/s^2, shape (2, n)) and their times (s) that returns the disturbed signals."""
START = datetime(2025, 1, 15, 9, tzinfo=UTC)
MONTH = timedelta(days=30)
RATE = 25600.0
MONTHS = 60
"""Months of a machine."""
HITS = 4
"""Good hits of a test."""
PATIENCE = 40.0
"""Time after which an operator without enough good hits gives up (s of the signal)."""
REST = 1.3
"""Time before the first hit (s)."""
MAX_REJECTED = 10
"""Rejected hits after which the operator gives up."""
ACCELEROMETERS = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1.02e-3, 2.5e-3, 5e-3, 1.02e-2)
"""Sensitivities of accelerometers (V per m/s^2)."""
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


def spread(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number evenly in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def modes_of(structure: Structure) -> list[Mode]:
    """Return the true modes."""
    rows = np.transpose([structure.frequency, structure.damping_ratio, structure.stiffness])
    return [Mode(*row) for row in rows.tolist()]


@dataclass(frozen=True)
class Truth:
    """Spindle with a tool in it."""

    x: Structure
    y: Structure
    beam: ToolBeam

    def of(self, direction: str) -> Structure:
        """Return the structure of a direction."""
        return self.x if direction == "x" else self.y


def scale(structure: Structure, frequency: float | Array = 1.0, stiffness: float | Array = 1.0) -> Structure:
    """Return a structure with frequencies and stiffnesses times factors."""
    return replace(structure, frequency=structure.frequency * frequency, stiffness=structure.stiffness * stiffness)


def random_truth(rng: np.random.Generator) -> Truth:
    """Draw a tool of carbide in a spindle. The static compliance at the tip is that of tool, holder and spindle.

    The frequencies of x and y differ by 0.2 % at least.
    """
    while True:
        diameter, slenderness = rng.uniform(8e-3, 25e-3), rng.uniform(3.0, 5.5)
        beam = ToolBeam(diameter, slenderness * diameter, slenderness * diameter, "carbide")
        high = rng.uniform(0.55, 0.9) * beam.frequency
        if 900 < high < 2600:
            break
    support = 1 / np.exp(rng.uniform(np.log(2.5e7), np.log(1.5e8)))
    share, low = rng.uniform(0.6, 0.95), rng.uniform(0.35, 0.7) * high
    compliance = np.array([support + (1 - share) * beam.compliance, share * beam.compliance])
    frequency, damping = np.array([low, high]), rng.uniform(0.012, 0.045, 2)
    x = Structure(frequency, damping, 1 / compliance)
    differ = np.zeros(2)
    while np.min(np.abs(differ)) < 0.002:
        differ = rng.choice([0.003, 0.01, 0.04]) * rng.standard_normal(2)
    y = scale(replace(x, damping_ratio=damping * np.exp(0.1 * rng.standard_normal(2))), np.exp(differ))
    return Truth(x, scale(y, 1.0, np.exp(0.08 * rng.standard_normal(2))), beam)


class Tapped(NamedTuple):
    """Result of one tap test."""

    codes: frozenset[str]
    """Codes that the operator sees: remarks and questions of the test, or why it was refused."""
    tap_id: str
    """Identity, empty if the test was refused."""


@dataclass(frozen=True)
class Wrong:
    """Faults of a tap test, none by default."""

    structure: Structure | None = None
    """Structure that is really hit, None for that of the direction."""
    gains: tuple[float, float] = (1.0, 1.0)
    """Voltages of force and acceleration over those that the board states."""
    disturb: Disturbance = lambda signals, _: signals
    """Disturbance of the signals."""
    rate_ratio: float | None = None
    """True sample rate over the stated one, in real time. None for a board without a clock."""
    width: float = 0.65e-3
    """Foot width of the pulses (s)."""
    tool: str = "cutter"
    """Tool as entered."""
    created: datetime | None = None
    """Time of the computer, None for the true one."""
    guided: bool = False
    """True if the clock of the computer is compared."""


RIGHT = Wrong()
"""Tap test without an error."""


class Synchronized(TapsSource):
    """Source that requests a block when the previous one is processed."""

    _frame_time = 0.06
    requested: threading.Semaphore

    def blocks(self) -> Iterator[Block]:
        """Yield blocks in turns with the board."""
        for block in super().blocks():
            yield block
            self.requested.release()


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


Watch = Callable[[TapSession], None]


@contextmanager
def serve(shop: Workshop, structure: Structure, wrong: Wrong) -> Iterator[tuple[Callable[[], Device], Watch]]:
    """Serve a tapped structure on a board that states the channels of the shop. Yields opener and watch."""
    true_rate, requested = RATE * (wrong.rate_ratio or 1.0), threading.Semaphore()
    hammered = HammeredStructure(structure, true_rate, shop.rng, choose_hammering(structure, shop, wrong))
    hammered._next_hit = REST * true_rate  # noqa: SLF001 - nobody hits during the self-check
    sessions: list[TapSession] = []
    gains = np.array(wrong.gains)[:, np.newaxis]

    def signal(first_scan: int, n_scans: int) -> Array:
        if wrong.rate_ratio is None:
            requested.acquire(timeout=0.2)
        seconds = (first_scan + np.arange(n_scans)) / true_rate
        if seconds[-1] > PATIENCE and sessions:
            sessions[0].stop()
        return gains * wrong.disturb(hammered(first_scan, n_scans), seconds)

    def open_device() -> Device:
        if wrong.rate_ratio is not None:
            return TapsSource(board.port)
        device = Synchronized(board.port)
        device.requested = requested
        return device

    ratio, begun = wrong.rate_ratio or 1.0, time.monotonic()
    board = TapsEmulator(
        signal,
        shop.channels,
        RATE,
        realtime=wrong.rate_ratio is not None,
        clock=lambda: (time.monotonic() - begun) * ratio,
    )
    with board:
        yield open_device, sessions.append
        requested.release()


def choose_sensors(structure: Structure, rng: np.random.Generator) -> tuple[Channel, Channel]:
    """Choose a hammer and an accelerometer whose range fits hits of a third of the range of the hammer."""
    hammer = Channel("force", float(rng.choice([2.25e-3, 1.1e-2, 2.3e-2])), 5.0)
    peak = 0.35 * hammer.full_scale / hammer.sensitivity * peak_response(structure)
    sizes = [size for size in ACCELEROMETERS if 0.5 * 5.0 / size >= peak]
    return hammer, Channel("acceleration", max(sizes, default=min(ACCELEROMETERS)), 5.0)


def peak_response(structure: Structure) -> float:
    """Return the largest acceleration after a pulse of 1 N (m/s^2)."""
    return float(np.max(np.abs(structure.response(np.arange(2000) / RATE, 0.65e-3))))


def resting_rms(shop: Workshop) -> float:
    """Return the noise of the acceleration at rest (m/s^2 rms)."""
    return choose_hammering(shop.truth.x, shop, RIGHT).response_noise


def choose_hammering(structure: Structure, shop: Workshop, wrong: Wrong) -> Hammering:
    """Return hits that use a third of the range of both sensors at most."""
    force, acceleration = (channel.full_scale / channel.sensitivity for channel in shop.channels)
    peak = peak_response(structure)
    high = 0.35 * min(force, 2 * acceleration / peak) / max(1.0, *wrong.gains)
    widths, steps = (0.85 * wrong.width, 1.15 * wrong.width), [abs(channel.scale) for channel in shop.channels]
    noise = max(2e-4 * high, steps[0]), max(2e-4 * high * peak, steps[1])
    return Hammering((0.5 * high, high), widths, overloads=0.0, force_noise=noise[0], response_noise=noise[1])


def run_session(session: TapSession, path: Path) -> Tapped:
    """Run a session as an operator does who gives up after some rejected hits."""
    seen: set[str] = set()
    n_rejected = 0

    def watch(state: TapState) -> None:
        nonlocal n_rejected
        seen.update({"screen:unfelt-hit"} if state.reason.startswith(UNFELT_HIT_TEXT.partition("{")[0]) else ())
        n_rejected += state.word is TapStep.REFUSED and state.trial
        seen.update(f"check:{check.name}" for check in state.checks if not check.passed)
        rejected = [code for hit in state.hits for code in hit.flags.codes]
        if n_rejected > MAX_REJECTED or len(rejected) > MAX_REJECTED + state.good:
            session.stop()

    session.wakes.add(lambda: watch(session.state))
    try:
        test = session.run()
    except TapStopped:
        flags = {code for hit in session.state.hits for code in hit.flags.codes}
        words = {session.state.verdict.replace(" ", "-")} if session.state.trial else set()
        return Tapped(frozenset({"refused", *seen, *(f"hit:{code}" for code in flags | words)}), "")
    except (DataError, DeviceError, ValueError):
        why = {f"refused:{code}" for code in session.questions.asked}
        why |= {"refused:rate"} if [*path.glob(f"spool/*/{RATE_FILE_NAME}")] else set()
        return Tapped(frozenset({"refused", *seen, *why}), "")
    seen.update(remark.code for remark in (*session.measurement.remarks, *session.remarks))
    return Tapped(frozenset(seen), test.id)


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
