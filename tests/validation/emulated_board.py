"""Emulated boards on hit structures, with the faults of a tap test, and an operator who gives up."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition import (
    Block,
    Channel,
    DataError,
    Device,
    DeviceError,
    HammeredStructure,
    Hammering,
    Structure,
    TapsEmulator,
    TapsSource,
)
from lobewatch.measurement.tool_compliance import ToolBeam
from lobewatch.tap.hit_loop import UNFELT_HIT_TEXT, TapStopped
from lobewatch.tap.kept_rate import RATE_FILE_NAME
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep
from modal import Mode

Array = NDArray[np.float64]
Disturbance = Callable[[Array, Array], Array]
"""Function of the signals (N and m/s^2, shape (2, n)) and their times (s) that returns the disturbed signals."""
RATE = 25600.0
PATIENCE = 40.0
"""Time after which an operator without enough good hits gives up (s of the signal)."""
REST = 1.3
"""Time before the first hit (s)."""
MAX_REJECTED = 10
"""Rejected hits after which the operator gives up."""
ACCELEROMETERS = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1.02e-3, 2.5e-3, 5e-3, 1.02e-2)
"""Sensitivities of accelerometers (V per m/s^2)."""


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


class Shop(Protocol):
    """Machine whose tool is hit."""

    rng: np.random.Generator
    truth: Truth
    channels: tuple[Channel, Channel]


class Synchronized(TapsSource):
    """Source that requests a block when the previous one is processed."""

    _frame_time = 0.06
    requested: threading.Semaphore

    def blocks(self) -> Iterator[Block]:
        """Yield blocks in turns with the board."""
        for block in super().blocks():
            yield block
            self.requested.release()


Watch = Callable[[TapSession], None]


@contextmanager
def serve(shop: Shop, structure: Structure, wrong: Wrong) -> Iterator[tuple[Callable[[], Device], Watch]]:
    """Serve a tapped structure on a board that states the channels of the shop. Yields opener and watch."""
    true_rate, requested = RATE * (wrong.rate_ratio or 1.0), threading.Semaphore()
    hammered = HammeredStructure(structure, true_rate, shop.rng, choose_hammering(structure, shop, wrong))
    hammered._next_hit = REST * true_rate  # noqa: SLF001 - nobody hits during the self-check
    sessions: list[TapSession] = []
    gains = np.array(wrong.gains)[:, np.newaxis]

    def signal(first_scan: int, n_scans: int) -> Array:
        if wrong.rate_ratio is None:
            requested.acquire(timeout=0.05)
        seconds = (first_scan + np.arange(n_scans)) / true_rate
        if seconds[-1] > PATIENCE and sessions:
            sessions[0].stop()
        if sessions and sessions[0].state.good >= sessions[0].state.wanted:
            hammered._next_hit = math.inf  # noqa: SLF001 - the operator puts the hammer away
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


def resting_rms(shop: Shop) -> float:
    """Return the noise of the acceleration at rest (m/s^2 rms)."""
    return choose_hammering(shop.truth.x, shop, RIGHT).response_noise


def choose_hammering(structure: Structure, shop: Shop, wrong: Wrong) -> Hammering:
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
