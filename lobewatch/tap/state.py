"""State of a tap test as the operator sees it, the same for browser and terminal."""

import enum
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

from acquisition import HitFlags, Remark
from lobewatch.arrays import Floats


class TapStep(enum.StrEnum):
    """Step of a tap test, as a word that can be read from 3 m."""

    ASK = "SPINDLE STOPPED?"
    """A person must say that the spindle is stopped, or stop it."""
    CHECKING = "CHECKING"
    """The self-check before the first hit runs."""
    TAP = "TAP"
    """Armed: the next hit is awaited."""
    WAIT = "WAIT"
    """The structure still vibrates, or a record is being taken."""
    GOOD = "GOOD"
    """The last hit was accepted."""
    REFUSED = "REFUSED"
    """The last hit was rejected. The screen shows its verdict instead of this word."""
    NO_DEVICE = "NO DEVICE"
    """The DAQ was unplugged or fell silent. The test resumes at the same hit when it is back."""
    MOVE = "MOVE SENSOR"
    """One direction is tapped. Hammer and sensor must be turned to the other."""
    DONE = "DONE"
    """Enough good hits. The result is there or being computed."""
    FAILED = "FAILED"
    """The test cannot go on. The reason says why and what to do."""


class Check(NamedTuple):
    """Result of one check before the first hit."""

    name: str
    """Name of the check, e.g. "force noise"."""
    passed: bool
    """True if all is well. A failed check warns and does not stop the test."""
    text: str
    """Finding with its unit, and the remedy if the check failed."""
    is_notable: bool = False
    """True if the finding deserves a line even if all is well."""


class ListedHit(NamedTuple):
    """Hit in the list of the screen."""

    number: int
    """Number of the hit, from 1."""
    flags: HitFlags
    """Flags of the hit, falsy if it is averaged."""
    peak: str
    """Largest force, or largest acceleration without a force sensor, with its unit."""
    undone: bool = False
    """True if the operator took it back."""
    reason: str = ""
    """Sentence with numbers on what is wrong with it, empty if it is averaged."""
    earlier: bool = False
    """True if it was taken before the test was interrupted."""
    accepted: HitFlags = HitFlags.OK
    """Faults despite which the operator accepted it."""

    @property
    def verdict(self) -> str:
        """Verdict in words, with the decision of the operator."""
        return f"{self.accepted.words}, accepted" if self.accepted else self.flags.words


@dataclass(frozen=True, eq=False)
class LiveCurves:
    """Curves of the screen, reduced to what a screen can show."""

    time: Floats
    """Time from the trigger of the last hit (s), shape (n,)."""
    force: Floats | None
    """Force of the last hit (N), shape (n,). None if not measured."""
    acceleration: Floats
    """Acceleration of the last hit (m/s^2), shape (n,)."""
    frequency: Floats
    """Frequencies (Hz), shape (m,)."""
    mean: Floats | None = None
    """Receptance magnitude of the mean of the good hits (m/N), shape (m,). None before the first good one."""
    last: Floats | None = None
    """Receptance magnitude of the last hit (m/N), shape (m,). None without a pulse. Without a force that of its
    free decay, up to a factor.
    """
    coherence: Floats | None = None
    """Coherence of the good hits (-), shape (m,). None for fewer than 3."""
    force_spectrum: Floats | None = None
    """Spectrum of the force of the last hit (dB below its largest value), shape (m,)."""
    usable_band: tuple[float, float] | None = None
    """Band that the force excites (Hz)."""


class Choice(NamedTuple):
    """Choice between two tests."""

    key: str
    """Key of the choice: "start", "still", "x", "y", "xy", "tool" or "done"."""
    text: str
    """Text of its button."""


class ProgramVerdict(NamedTuple):
    """Program and its verdict."""

    program: str
    """Name, speed and depth."""
    word: str
    """Verdict word."""


class Outcome(NamedTuple):
    """Result of a finished test."""

    status: str
    """Status of the machine: "good", "warn" or "alarm", against the baseline and the limits of machine.toml."""
    texts: Sequence[str]
    """Result in sentences."""
    next_step: str
    """Sentence on what to do now."""
    is_early: bool = False
    """True if the alarm is for a frequency drop within every limit."""
    programs: Sequence[ProgramVerdict] = ()
    """Programs with their verdicts."""
    needs_cross_tap: bool = False
    """True if a cross tap, hit in x and measured in y, would resolve what x and y leave open."""


@dataclass(frozen=True, eq=False)
class LiveState:
    """State of a live test or cut."""

    revision: int
    """Number that increases with every change."""


@dataclass(frozen=True, eq=False)
class TapState(LiveState):
    """State of a tap test."""

    word: TapStep
    """Step."""
    title: str
    """Machine, tool and direction."""
    direction: str = ""
    """Direction to tap: "x", "y" or "xy", empty if it does not matter."""
    resumed: str = ""
    """Interrupted test that is resumed, its good hits, and damaged files set aside. Empty for a new test."""
    device: str = ""
    """DAQ, port and rate."""
    verdict: str = ""
    """Verdict on the last hit, e.g. "good" or "double hit, too soft"."""
    trial: bool = False
    """True if the last hit was a trial hit, which does not count."""
    reason: str = ""
    """Sentence with numbers on what was wrong with the last hit, or why the test waits."""
    good: int = 0
    """Number of hits averaged so far."""
    wanted: int = 10
    """Number of hits to average."""
    hits: tuple[ListedHit, ...] = ()
    """All hits, oldest first."""
    mean_change: float | None = None
    """Relative change of the mean by the last good hit (-). None for fewer than 2."""
    settled: bool = False
    """True if the mean has converged. The required number of hits still applies."""
    hit_change: Remark | None = None
    """Most flexible mode that changes from hit to hit, with the remedy. None if the good hits show none."""
    levels: tuple[float | None, float] | None = None
    """RMS of force (N, None if not measured) and acceleration (m/s^2) over the last 50 ms."""
    checks: tuple[Check, ...] = ()
    """Lines of the self-check."""
    plots: LiveCurves | None = None
    """Curves of the last hit and the mean."""
    outcome: Outcome | None = None
    """Result, None before the end."""
    choices: tuple[Choice, ...] = ()
    """Choices available now, empty while a test runs."""
    sensor_stays: bool = False
    """True if only the hammer must be moved: the sensors measure x and y."""

    @property
    def shown_word(self) -> str:
        """Word as a screen shows it: the verdict instead of REFUSED, and what must be moved."""
        if self.word is TapStep.MOVE and self.sensor_stays:
            return "MOVE HAMMER"
        if self.word is not TapStep.REFUSED or not self.verdict:
            return self.word.value
        return f"{self.verdict}{', trial hit' if self.trial else ''}".upper()


State = TypeVar("State", bound=LiveState)


class StatePublisher(Generic[State]):
    """Publisher of the state of a live test.

    The thread of the test replaces the state, never changes it. Any thread may read it.
    """

    def __init__(self, first: State, clock: Callable[[], float] = time.monotonic) -> None:
        """Publish the first state. clock: monotonic time (s)."""
        self.state: State = first
        """Newest state."""
        self._clock, self._shown_at = clock, clock()
        self.wakes: set[Callable[[], None]] = set()
        """Functions called after every change by the thread of the test. None may take time."""

    @property
    def age(self) -> float:
        """Time since the last change (s)."""
        return self._clock() - self._shown_at

    def show(self, **changes: Any) -> None:
        """Replace the state by one with these changed fields."""
        self.state = replace(self.state, revision=self.state.revision + 1, **changes)
        self._shown_at = self._clock()
        for wake in tuple(self.wakes):
            wake()
