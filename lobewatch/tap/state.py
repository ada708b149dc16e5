"""What the operator is shown during a tap test: one immutable picture of it, the same for browser and terminal."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import HitFlags


class TapStep(enum.StrEnum):
    """The word that can be read from 3 m."""

    CHECKING = "CHECKING"
    """The self-check before the first hit runs."""
    TAP = "TAP"
    """Armed: the next hit is waited for."""
    WAIT = "WAIT"
    """The structure still rings, or a record is being taken."""
    GOOD = "GOOD"
    """The last hit was accepted."""
    REFUSED = "REFUSED"
    """The last hit was refused; the screen shows its verdict instead of this word."""
    NO_DEVICE = "NO DEVICE"
    """The DAQ was unplugged or fell silent; the test goes on at the same hit when it is back."""
    DONE = "DONE"
    """Enough good hits; the result is there or being worked out."""
    FAILED = "FAILED"
    """The test cannot go on; the reason says why, the cure what to do."""


@dataclass(frozen=True)
class Check:
    """One line of the self-check before hit 1."""

    name: str
    """What was looked at, e.g. "noise floor"."""
    passed: bool
    """Whether all is well; a failed check warns and does not stop the test."""
    text: str
    """What was found, with its unit, and the cure where it failed."""


@dataclass(frozen=True)
class TakenHit:
    """One hit in the list of the screen."""

    number: int
    """From 1."""
    flags: HitFlags
    """Falsy where it is averaged."""
    peak_force: float
    """N."""
    undone: bool = False
    """Taken back by the operator."""
    reason: str = ""
    """One sentence with figures: what was wrong with it; empty where it is averaged."""
    earlier: bool = False
    """Taken before the test was interrupted."""


@dataclass(frozen=True, eq=False)
class Plots:
    """The curves of the screen, thinned to what a screen can show."""

    time: NDArray[np.float64]
    """From the trigger of the last hit (s), shape (n,)."""
    force: NDArray[np.float64]
    """Of the last hit (N), shape (n,)."""
    acceleration: NDArray[np.float64]
    """Of the last hit (m/s^2), shape (n,)."""
    frequency: NDArray[np.float64]
    """Hz, shape (m,)."""
    mean: NDArray[np.float64] | None
    """|receptance| of the mean of the good hits (m/N), shape (m,); None before the first good one."""
    last: NDArray[np.float64] | None
    """|receptance| of the last hit (m/N), shape (m,); None where it had no pulse."""
    coherence: NDArray[np.float64] | None
    """Of the good hits, shape (m,); None under 3 of them."""
    force_spectrum: NDArray[np.float64] | None
    """Of the last hit, dB below its largest value, shape (m,)."""
    usable_band: tuple[float, float] | None
    """Band in which the force reaches (Hz)."""


@dataclass(frozen=True)
class Outcome:
    """What stands at the end."""

    light: str
    """"good", "warn" or "alarm", against the baseline and the limits of machine.toml."""
    texts: Sequence[str]
    """The result in sentences."""
    next_step: str
    """What to do now, one sentence."""


@dataclass(frozen=True, eq=False)
class TapState:
    """One picture of a tap test."""

    revision: int
    """Rises with every change."""
    word: TapStep
    """See Word."""
    title: str
    """Machine, tool and direction."""
    resumed: str = ""
    """Where an interrupted test is gone on with: which one, how many good hits it had, and damaged files that were set
    aside; empty for a new one."""
    device: str = ""
    """DAQ, port and rate."""
    verdict: str = ""
    """Of the last hit, e.g. "good" or "double hit, too soft"."""
    trial: bool = False
    """Whether the last hit was a trial hit, which does not count."""
    reason: str = ""
    """One sentence with figures: what was wrong with the last hit, or why the test stands still."""
    good: int = 0
    """Hits averaged so far."""
    wanted: int = 10
    """Hits to be averaged."""
    hits: tuple[TakenHit, ...] = ()
    """All hits, oldest first."""
    mean_change: float | None = None
    """By which share the last good hit moved the mean; None under 2 of them."""
    settled: bool = False
    """Whether the mean has settled (a hint: the wanted number stays the rule)."""
    levels: tuple[float, float] | None = None
    """rms of force (N) and acceleration (m/s^2) over the last 50 ms, live."""
    checks: tuple[Check, ...] = ()
    """Self-check."""
    plots: Plots | None = None
    """Of the last hit and the mean."""
    outcome: Outcome | None = None
    """At the end."""

    @property
    def shown_word(self) -> str:
        """The word as a screen shows it: the verdict in place of REFUSED."""
        if self.word is not TapStep.REFUSED or not self.verdict:
            return self.word.value
        return f"{self.verdict}{', trial hit' if self.trial else ''}".upper()
