"""What the operator is shown during a tap test: one immutable picture of it, the same for browser and terminal."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
    MOVE = "MOVE SENSOR"
    """One direction is tapped; hammer and sensor are to be turned to the other."""
    DONE = "DONE"
    """Enough good hits; the result is there or being worked out."""
    FAILED = "FAILED"
    """The test cannot go on; the reason says why, the cure what to do."""


@dataclass(frozen=True)
class Check:
    """One line of the self-check before hit 1."""

    name: str
    """Name of the check, e.g. "noise floor"."""
    passed: bool
    """Whether all is well; a failed check warns and does not stop the test."""
    text: str
    """Finding with its unit, and the cure where it failed."""
    is_notable: bool = False
    """Whether the finding is worth a line where all is well, too."""


@dataclass(frozen=True)
class ListedHit:
    """One hit in the list of the screen."""

    number: int
    """Number of the hit, from 1."""
    flags: HitFlags
    """Verdict on the hit; falsy where it is averaged."""
    peak: str
    """Largest force, or largest acceleration where no force was measured, with its unit."""
    undone: bool = False
    """Whether the operator took it back."""
    reason: str = ""
    """Sentence with figures: what was wrong with it; empty where it is averaged."""
    earlier: bool = False
    """Whether it was taken before the test was interrupted."""


@dataclass(frozen=True, eq=False)
class LiveCurves:
    """The curves of the screen, thinned to what a screen can show."""

    time: NDArray[np.float64]
    """Time from the trigger of the last hit (s), shape (n,)."""
    force: NDArray[np.float64] | None
    """Force of the last hit (N), shape (n,); None where none was measured."""
    acceleration: NDArray[np.float64]
    """Acceleration of the last hit (m/s^2), shape (n,)."""
    frequency: NDArray[np.float64]
    """Frequencies (Hz), shape (m,)."""
    mean: NDArray[np.float64] | None
    """Magnitude of the receptance of the mean of the good hits (m/N), shape (m,); None before the first good one."""
    last: NDArray[np.float64] | None
    """Magnitude of the receptance of the last hit (m/N), shape (m,); None where it had no pulse; without a force that
    of its free decay, up to a factor."""
    coherence: NDArray[np.float64] | None
    """Coherence of the good hits (-), shape (m,); None under 3 of them."""
    force_spectrum: NDArray[np.float64] | None
    """Spectrum of the force of the last hit (dB below its largest value), shape (m,)."""
    usable_band: tuple[float, float] | None
    """Band in which the force reaches (Hz)."""


class Choice(NamedTuple):
    """What a person can choose between two tests."""

    key: str
    """Key that stands for it: "x", "y", "tool" or "done"."""
    text: str
    """Words on its button."""


class ProgramVerdict(NamedTuple):
    """A program and the word on it."""

    program: str
    """Name, speed and depth."""
    word: str
    """Word on it."""


@dataclass(frozen=True)
class Outcome:
    """The result as it stands at the end."""

    status: str
    """Light of the machine: "good", "warn" or "alarm", against the baseline and the limits of machine.toml."""
    texts: Sequence[str]
    """Result in sentences."""
    next_step: str
    """Sentence on what to do now."""
    is_early: bool = False
    """Whether the alarm is that of a fall short of every limit."""
    programs: Sequence[ProgramVerdict] = ()
    """Programs with the words on them."""
    needs_cross_tap: bool = False
    """Whether a tap across, hit in x and seen in y, would settle what x and y leave open of the tool."""


@dataclass(frozen=True, eq=False)
class TapState:
    """One picture of a tap test."""

    revision: int
    """Number that rises with every change."""
    word: TapStep
    """Word that can be read from 3 m."""
    title: str
    """Machine, tool and direction."""
    direction: str = ""
    """Direction to be tapped: "x", "y" or "xy"; empty where it does not matter."""
    resumed: str = ""
    """Interrupted test that is gone on with, how many good hits it had, and damaged files that were set aside; empty
    for a new one."""
    device: str = ""
    """DAQ, port and rate."""
    verdict: str = ""
    """Verdict on the last hit, e.g. "good" or "double hit, too soft"."""
    trial: bool = False
    """Whether the last hit was a trial hit, which does not count."""
    reason: str = ""
    """Sentence with figures: what was wrong with the last hit, or why the test stands still."""
    good: int = 0
    """Hits averaged so far."""
    wanted: int = 10
    """Hits to be averaged."""
    hits: tuple[ListedHit, ...] = ()
    """All hits, oldest first."""
    mean_change: float | None = None
    """Share by which the last good hit moved the mean (-); None under 2 of them."""
    settled: bool = False
    """Whether the mean has settled (a hint: the wanted number stays the rule)."""
    levels: tuple[float | None, float] | None = None
    """Root mean squares of force (N; None where not measured) and acceleration (m/s^2) over the last 50 ms."""
    checks: tuple[Check, ...] = ()
    """Lines of the self-check."""
    plots: LiveCurves | None = None
    """Curves of the last hit and the mean."""
    outcome: Outcome | None = None
    """Result; None before the end."""
    choices: tuple[Choice, ...] = ()
    """What can be chosen now; empty while a test runs."""
    sensor_stays: bool = False
    """Whether the hammer alone is to be moved: the sensor feels x and y."""

    @property
    def shown_word(self) -> str:
        """Word as a screen shows it: the verdict in place of REFUSED, and what is to be moved."""
        if self.word is TapStep.MOVE and self.sensor_stays:
            return "MOVE HAMMER"
        if self.word is not TapStep.REFUSED or not self.verdict:
            return self.word.value
        return f"{self.verdict}{', trial hit' if self.trial else ''}".upper()
