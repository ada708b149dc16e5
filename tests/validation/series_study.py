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
        self.error = 10 ** rng.uniform(-5, -4)

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


def gain_error(ratios: tuple[float, ...], at: tuple[int, ...], directions: str = "xy") -> Error:
    """Return gains that change at these sessions."""

    def change(number: int, session: Session) -> Session:
        gain = float(np.prod([r for r, first in zip(ratios, at, strict=True) if number >= first]))
        wrong = {d: (getattr(session, d)[0], getattr(session, d)[1] * gain) for d in directions}
        return session._replace(**wrong)

    return change


def tool_error(ratio: float, at: int) -> Error:
    """Return a tool whose length is that many times as long: f as L^-1, K as L^-3, as in the report."""

    def change(number: int, session: Session) -> Session:
        if number < at:
            return session
        return Session(*((f / ratio, k / ratio**3) for f, k in session))

    return change


def sensor_left_error(at: int, rng: np.random.Generator, error: float, stiffness_std: float) -> Error:
    """Return a y that repeats x, within its errors of measurement."""

    def change(number: int, session: Session) -> Session:
        if number < at:
            return session
        f, k = session.x
        return session._replace(
            y=(f * (1 + error * np.sqrt(2) * rng.standard_normal()), k * (1 + 0.01 * rng.standard_normal()))
        )

    return change


def run(machine: Machine, change: Error | None = None) -> list[list[str]]:
    sessions = machine.sessions()
    if change is not None:
        sessions = [change(number, session) for number, session in enumerate(sessions)]
    return ask_all(sessions, machine.error)
