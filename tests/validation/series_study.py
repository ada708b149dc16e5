"""Series of tap tests of random machines, honest and with human errors, through the questions of a series."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.measurement.series_questions import (
    EarlierTest,
    SeriesReference,
    check_same_direction,
    check_series,
)
from modal import Mode

N_TESTS = 24
"""Monthly tests of a series in each direction."""
START = datetime(2026, 1, 15, 9, tzinfo=UTC)
"""Time of the first test."""
Array = NDArray[np.float64]


class Session(NamedTuple):
    """Results of one day by direction: frequency (Hz) and stiffness (N/m)."""

    x: tuple[float, float]
    y: tuple[float, float]


Error = Callable[[int, Session], Session]
"""Human error: changes the results of a session with its number."""


@dataclass
class Machine:
    """Random machine: tool and spindle in x and y, wear, three operators and reclamping."""

    rng: np.random.Generator
    stiffness_std: float
    frequency: Array = field(init=False)
    stiffness: Array = field(init=False)

    def __post_init__(self) -> None:
        """Draw the machine."""
        rng = self.rng
        asymmetry = np.exp(rng.choice([0.0005, 0.005, 0.03]) * rng.standard_normal())
        self.frequency = float(np.exp(rng.uniform(np.log(300), np.log(3000)))) * np.array([1.0, asymmetry])
        stiffness = np.exp(rng.uniform(np.log(3e6), np.log(1e8)))
        self.stiffness = stiffness * np.exp(0.1 * rng.standard_normal(2))
        self.reclamping = np.exp(rng.uniform(np.log(5e-4), np.log(5e-3)))
        self.drop = rng.uniform(0, 0.10) * (rng.random() < 0.7)
        self.pace = rng.choice([1.0, 3.0])
        self.exponent = rng.uniform(0.1, 3.8)
        operators = rng.standard_normal(3)
        self.operators = 0.5 * self.stiffness_std * operators
        self.error = rng.uniform(5e-6, 3e-5)

    def sessions(self) -> list[Session]:
        """Draw the sessions of an honest series; a quarter of the variance of K is that of the operators."""
        found = []
        for number in range(N_TESTS):
            wear = 1 - self.drop * (number / (N_TESTS - 1)) ** self.pace
            operator, both = self.operators[self.rng.integers(3)], []
            for f, k in zip(self.frequency, self.stiffness, strict=True):
                reclamped = np.exp(self.reclamping * self.rng.standard_normal())
                scatter = operator + np.sqrt(0.75) * self.stiffness_std * self.rng.standard_normal()
                both.append((f * wear * reclamped, k * (wear * reclamped) ** self.exponent * np.exp(scatter)))
            found.append(Session(*both))
        return found


def ask_all(sessions: list[Session], error: float) -> list[list[str]]:
    """Return the codes asked in each session, none answered; error: relative, of the frequencies."""
    tests: dict[str, list[EarlierTest]] = {"x": [], "y": []}
    asked = []
    for number, session in enumerate(sessions):
        codes: list[str] = []
        day: tuple[float, ...] = ()
        for direction, across, values in (("x", "y", session.x), ("y", "x", session.y)):
            f, k = values
            std = np.diag([error * f, 1e-4, 3e-3 * k])
            now = Mode(f, 0.03, k, covariance=std**2)
            reference = SeriesReference(tuple(tests[direction]), tuple(tests[across]), day)
            same = check_same_direction(now, [now], reference)
            found = [remark.code for remark in (*check_series(now, reference), *([same] if same else []))]
            day, codes = (f,), codes + found
            if not found:
                time = START + timedelta(days=30 * number, hours=direction == "y")
                tests[direction].append(EarlierTest(time, f, k))
        asked.append(codes)
    return asked


def gain_error(rng: np.random.Generator, firsts: tuple[int, int], *, five_steps: bool = False) -> tuple[int, Error]:
    """Return a gain of 1.3 to 3 or its inverse, and the first session with all of it.

    In one step, in two steps, or slowly over three to eight sessions; or in five steps.
    firsts: range of the session of the first step.
    """
    ratio = float(np.exp(rng.uniform(np.log(1.3), np.log(3)) * rng.choice([-1, 1])))
    first, slowly = int(rng.integers(*firsts)), int(rng.integers(3, 9))
    ways = [[first], [first, int(rng.integers(first + 1, N_TESTS))], [*range(first, min(first + slowly, N_TESTS))]]
    steps = np.arange(first, first + 5) if five_steps else np.array(ways[rng.integers(3)])
    directions = ("x", "y") if rng.random() < 0.7 else ("y",)

    def change(number: int, session: Session) -> Session:
        gain = ratio ** float(np.mean(steps <= number))
        return session._replace(**{d: (getattr(session, d)[0], getattr(session, d)[1] * gain) for d in directions})

    return int(steps[-1]), change


def shorter_tool(rng: np.random.Generator) -> tuple[int, Error]:
    """Return a tool shorter by 6 to 15 % under the old name, f as 1/L and K as 1/L^3, and its first session."""
    first, ratio = int(rng.integers(4, N_TESTS)), float(rng.uniform(0.85, 0.94))

    def change(number: int, session: Session) -> Session:
        return session if number < first else Session(*((f / ratio, k / ratio**3) for f, k in session))

    return first, change


def sensor_left(rng: np.random.Generator, first: int, error: float) -> tuple[int, Error]:
    """Return y that repeats x within its errors of measurement, and its first session."""

    def change(number: int, session: Session) -> Session:
        if number < first:
            return session
        f, k = session.x
        noise = rng.standard_normal(2)
        return session._replace(y=(f * (1 + error * np.sqrt(2) * noise[0]), k * (1 + 0.01 * noise[1])))

    return first, change


class Counts(NamedTuple):
    """Machines on which nothing was asked."""

    at_once: int
    """In the first session with the whole error."""
    ever: int
    """In no session with it."""


def run(machine: Machine, change: Error | None = None) -> list[list[str]]:
    """Return the codes asked in each session of a machine."""
    sessions = machine.sessions()
    if change is not None:
        sessions = [change(number, session) for number, session in enumerate(sessions)]
    return ask_all(sessions, machine.error)


def count_questions(machines: int, stiffness_std: float, seed: int) -> list[int]:
    """Return the number of questions in each honest series."""
    rng = np.random.default_rng(seed)
    return [sum(map(len, run(Machine(rng, stiffness_std)))) for _ in range(machines)]


def make_error(kind: str, machine: Machine, rng: np.random.Generator) -> tuple[int, Error]:
    """Return a human error of a kind, and its first session."""
    if "gain" in kind:
        firsts = (1, 4) if "young" in kind else (4, N_TESTS - 5)
        return gain_error(rng, firsts, five_steps=kind.endswith("in five steps"))
    if kind == "shorter tool":
        return shorter_tool(rng)
    return sensor_left(rng, 0 if kind.endswith("at once") else int(rng.integers(4, N_TESTS)), machine.error)


def count_silent(kind: str, machines: int, stiffness_std: float, seed: int) -> Counts:
    """Return on how many machines an error of this kind is silent.

    Machines that are round within 0.2 % do not count for a sensor left in x: y is like x.
    """
    rng, silent = np.random.default_rng(seed), list[tuple[bool, bool]]()
    while len(silent) < machines:
        machine = Machine(rng, stiffness_std)
        if kind.startswith("sensor") and abs(machine.frequency[1] / machine.frequency[0] - 1) < 0.002:
            continue
        first, change = make_error(kind, machine, rng)
        asked = run(machine, change)
        silent.append((not asked[first], not any(asked[first:])))
    return Counts(*np.sum(silent, axis=0).tolist())
