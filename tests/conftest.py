"""Fixtures that several tests share."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import NDArray

from acquisition import Channel, HammeredStructure, Hammering, HitFlags, Structure
from lobewatch.tap.state import Check, Choice, ListedHit, LiveCurves, Outcome, ProgramVerdict, TapState, TapStep

DATA = Path(__file__).parent / "data"
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture
def beam() -> Path:
    """Return the file of a clean real hammer hit on a beam: force in N, acceleration in g."""
    return DATA / "ladisk_beam" / "acceleration.lvm"


@pytest.fixture
def clipped_beam() -> Path:
    """Return the file of a real hit with a clipped accelerometer."""
    return DATA / "ladisk_beam" / "camera.lvm"


@pytest.fixture
def cnc_csv() -> Path:
    """Return the file of a real CNC tap test without a force channel."""
    return DATA / "rpi_cnc_tap" / "tap_20260622_163222.csv"


@pytest.fixture
def channels() -> tuple[Channel, Channel]:
    """Hammer and accelerometer on a 16-bit converter."""
    return Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)


@pytest.fixture
def structure() -> Structure:
    """Three modes and a static residual."""
    return Structure(
        frequency=np.array([900.0, 1722.0, 3000.0]),
        damping_ratio=np.array([0.03, 0.029136, 0.02]),
        stiffness=np.array([8e7, 3.2289e7, 1e8]),
        residual=1e-9,
    )


Tapper = Callable[..., HammeredStructure]


@pytest.fixture
def tapper(structure: Structure) -> Tapper:
    """Return a function that makes a hammered `structure` at 25.6 kHz, without faults unless requested."""

    def make(seed: int = 1, **hammering: object) -> HammeredStructure:
        faultless: dict[str, object] = {"double_hits": 0.0, "overloads": 0.0}
        how = Hammering(**(faultless | hammering))  # type: ignore[arg-type]
        return HammeredStructure(structure, 25600.0, np.random.default_rng(seed), how)

    return make


@pytest.fixture
def true_receptance(structure: Structure) -> Callable[[NDArray[np.float64]], NDArray[np.complex128]]:
    """Receptance (m/N) of `structure` at frequencies (Hz)."""

    def at(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        r = frequency[:, None] / structure.frequency
        modes = 1 / (structure.stiffness * (1 - r**2 + 2j * structure.damping_ratio * r))
        return np.asarray(modes.sum(axis=1) + structure.residual)

    return at


class ScriptedSession:
    """Live tap test without device and clock, whose steps the test scripts."""

    def __init__(self) -> None:
        self.state = TapState(1, TapStep.CHECKING, "mill-3, tool reference, direction x", device="DI-2108, 51200 Hz")
        self.wakes: set[Callable[[], None]] = set()
        self.undone = threading.Event()
        self.stopped = threading.Event()
        self.refusal = ""
        self.chosen: list[tuple[str, str]] = []
        self.decided: list[tuple[int | None, bool]] = []

    def show(self, word: TapStep, **changes: object) -> TapState:
        """Switch to the next state."""
        self.state = replace(self.state, revision=self.state.revision + 1, word=word, **changes)  # type: ignore[arg-type]
        for wake in tuple(self.wakes):
            wake()
        return self.state

    def check(self) -> None:
        """Show the self-check with one failed line."""
        passed = [("device", "DI-2108, serial 5C0A"), ("hum", "0.02 N at 50 Hz"), ("disk", "112 GB free")]
        failed = Check("noise floor", False, "4.1 N rms is above 2 N: is the spindle stopped, the hammer at rest?")
        self.show(TapStep.CHECKING, checks=(*(Check(name, True, text) for name, text in passed), failed))

    def hit(self, flags: HitFlags = HitFlags.OK, reason: str = "") -> None:
        """One more hit."""
        good = self.state.good + (not flags)
        taken = ListedHit(len(self.state.hits) + 1, flags, f"{312 + 7 * len(self.state.hits)} N")
        self.show(
            TapStep.REFUSED if flags else TapStep.GOOD,
            verdict=flags.words,
            reason=reason,
            good=good,
            hits=(*self.state.hits, taken),
            mean_change=0.3 / good**2 if good > 1 else None,
            settled=good >= 8,
            levels=(0.4, 12.5),
            plots=scripted_plots(good),
        )

    def finish(self) -> None:
        """All hits are there."""
        texts = ("f_1 1688.20 ± 0.12 Hz, 1.9 % below the first test", "K 33.1 ± 0.2 N/um, bearing stiffness 1190 N/um")
        words = ("bracket, slot (8000 rpm, 2 mm)", "stable"), ("pocket (12600 rpm, 2.5 mm)", "not stable")
        programs = [ProgramVerdict(*word) for word in words]
        step = "Tap again in 14 days, and run lobewatch check mill-3 today."
        done = Outcome("warn", texts, step, programs=programs)
        self.show(TapStep.DONE, reason="", outcome=done)

    def pause(self, word: TapStep, *choices: tuple[str, str], reason: str = "") -> None:
        """Wait for a person between two tests."""
        self.show(word, reason=reason, choices=tuple(Choice(*choice) for choice in choices))

    def undo(self) -> None:
        """Take back the last good hit."""
        if self.refusal:
            raise ValueError(self.refusal)
        hits = list(self.state.hits)
        last = max(i for i, hit in enumerate(hits) if not hit.flags and not hit.undone)
        hits[last] = hits[last]._replace(undone=True)
        self.show(TapStep.TAP, hits=tuple(hits), good=self.state.good - 1)
        self.undone.set()

    def decide(self, number: int | None, *, accept: bool) -> None:
        """Remember what was decided, and count the hit."""
        self.decided.append((number, accept))
        hits = list(self.state.hits)
        last = (number or len(hits)) - 1
        faults = hits[last].flags if accept else HitFlags.OK
        hits[last] = hits[last]._replace(flags=HitFlags.OK if accept else HitFlags.UNDONE, accepted=faults)
        good = self.state.good + (1 if accept else -1)
        self.show(TapStep.GOOD if accept else TapStep.TAP, hits=tuple(hits), good=good)

    def stop(self) -> None:
        """Remember that it was asked for."""
        self.stopped.set()

    def choose(self, key: str, tool: str = "") -> None:
        """Remember what was chosen."""
        self.chosen.append((key, tool))


def scripted_plots(good: int) -> LiveCurves:
    """Return a pulse, a ring-down and the FRF of one mode at 1722 Hz."""
    time = np.linspace(-0.02, 0.23, 2001)
    frequency = np.linspace(4.0, 12800.0, 1500)
    ringing = np.where(time > 0, np.exp(-300 * time) * np.sin(2 * np.pi * 1722 * time), 0.0)
    ratio = frequency / 1722
    receptance = np.abs(1 / (3.2e7 * (1 - ratio**2 + 0.06j * ratio))) + 1e-9 + 1e-4 / frequency**2
    return LiveCurves(
        time,
        312 * np.exp(-(((time - 4e-4) / 3e-4) ** 2)),
        900 * ringing,
        frequency,
        receptance if good else None,
        receptance * (1 + 0.1 * np.sin(frequency / 90)),
        np.clip(1 - 0.02 * (frequency / 4000) ** 4, 0, 1) if good >= 3 else None,
        -((frequency / 900) ** 1.4),
        (4.0, 7600.0),
    )


@pytest.fixture
def session() -> ScriptedSession:
    """Return a tap test that shows what a test scripts."""
    return ScriptedSession()
