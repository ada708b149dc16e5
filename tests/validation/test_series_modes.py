"""Questions from all modes of honest series are rare, and errors in them are named."""

from __future__ import annotations

import sys
from collections import Counter
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.measurement.series_modes import check_all_modes
from lobewatch.measurement.series_questions import EarlierTest, SeriesReference
from modal import Mode

N_TESTS = 24
START = datetime(2026, 1, 15, 9, tzinfo=UTC)
Array = NDArray[np.float64]


class Machine:
    """Random machine with two or three modes in x and y, wear, reclamping and scatter of damping and stiffness."""

    def __init__(self, rng: np.random.Generator, damping_std: float) -> None:
        """Draw it."""
        self.rng, self.damping_std, count = rng, damping_std, int(rng.integers(2, 4))
        steps = np.cumprod([rng.uniform(300, 1200), *rng.uniform(1.35, 2.5, count - 1)])
        differ = rng.choice([0.0005, 0.005, 0.03]) * rng.standard_normal((2, count))
        self.frequency = steps * np.exp(differ)
        self.damping = rng.uniform(0.01, 0.05, count) * np.exp(0.1 * rng.standard_normal((2, count)))
        self.stiffness = np.exp(rng.uniform(np.log(1e7), np.log(6e7), count)) * np.ones((2, 1))
        self.reclamping, self.is_one_clamping = np.exp(rng.uniform(np.log(5e-4), np.log(5e-3))), rng.random() < 0.5
        self.drop = rng.uniform(0, 0.1, count) * (rng.random() < 0.7)
        self.exponent = rng.uniform(0.1, 3.8, count)

    def session(self, number: int) -> Array:
        """Return frequency, damping ratio and stiffness of the modes in x and y, shape (2, n, 3)."""
        rng, shape = self.rng, self.frequency.shape
        reclamped = rng.standard_normal((1 if self.is_one_clamping else 2, 1)) * np.ones((2, 1))
        own = 2e-4 * rng.standard_normal(shape)
        moved = (1 - self.drop * number / N_TESTS) * np.exp(self.reclamping * reclamped + own)
        damping = self.damping * np.exp(self.damping_std * rng.standard_normal(shape))
        stiffness = self.stiffness * moved**self.exponent * np.exp(0.05 * rng.standard_normal(shape))
        return np.stack([self.frequency * moved, damping, stiffness], axis=-1)


def ask_all(sessions: list[Array]) -> list[set[str]]:
    """Return the codes asked in each session, none answered."""
    tests: list[list[EarlierTest]] = [[], []]
    asked = []
    for number, session in enumerate(sessions):
        codes = set()
        for direction, rows in enumerate(session):
            day = tuple(session[0, :, 0]) if direction else ()
            reference = SeriesReference(tuple(tests[direction]), tuple(tests[1 - direction]), day)
            found = {remark.code for remark in check_all_modes([Mode(*row) for row in rows], reference)}
            codes |= found
            if not found:
                time = START + timedelta(days=30 * number, hours=direction)
                modes = tuple((f, zeta, k, 0.0) for f, zeta, k in rows.tolist())
                tests[direction].append(EarlierTest(time, rows[0, 0], rows[0, 2], modes=modes))
        asked.append(codes)
    return asked


LONG = [pytest.param(200, std, marks=pytest.mark.long) for std in (0.03, 0.1, 0.2)]


@pytest.mark.parametrize(("count", "damping_std"), [(25, 0.1), *LONG])
def test_honest_series_are_left_alone(count: int, damping_std: float) -> None:
    numbers, asking, stiffness, repeated = Counter[str](), 0, 0, 0
    for rng in np.random.default_rng(7).spawn(count):
        machine = Machine(rng, damping_std)
        codes = [code for codes in ask_all([machine.session(n) for n in range(N_TESTS)]) for code in codes]
        numbers.update(codes)
        asking += bool({*codes} - {"stiffness-jump"})
        stiffness, repeated = stiffness + ("stiffness-jump" in codes), repeated + (len(codes) > 1)
    sys.stdout.write(f"scatter of zeta {damping_std}: {asking} of {count} series ask, {dict(numbers)}\n")
    assert asking <= (0.1 if damping_std > 0.1 else 0.03) * count
    assert stiffness <= 0.08 * count
    assert repeated <= 0.03 * count


def window(session: Array, rng: np.random.Generator) -> Array:
    """Return a session with a window that raises zeta of the first mode by 15 to 60 %."""
    rise = rng.uniform(0.15, 0.6) * session[0, 0, 0] * session[0, 0, 1]
    damping = session[:, :, 1] + rise / session[:, :, 0]
    return np.stack([session[:, :, 0], damping, session[:, :, 2]], axis=-1)


def test_errors_are_named() -> None:
    count, named, differences = 40, Counter[str](), 0
    for rng in np.random.default_rng(8).spawn(count):
        machine = Machine(rng, 0.03)
        sessions = [machine.session(n) for n in range(8)]
        spindle = (
            sessions[-1] * np.where(np.arange(machine.frequency.shape[1]) == 1, rng.choice([0.7, 1.2]), 1.0)[:, None]
        )
        spindle[:, :, 1:] = sessions[-1][:, :, 1:]
        wrong = {
            "mode-jump": spindle,
            "exchanged-directions": sessions[-1][::-1],
            "damping-jump": window(sessions[-1], rng),
        }
        differences += (
            np.max(np.abs(np.log(machine.frequency[0] / machine.frequency[1]))) > 5 * machine.reclamping + 0.004
        )
        named.update(code for code, last in wrong.items() if code in ask_all([*sessions[:-1], last])[-1])
    sys.stdout.write(f"{dict(named)} of {count}\n")
    assert named["exchanged-directions"] >= 0.95 * differences > 0
    assert named["mode-jump"] >= 0.95 * count
    assert named["damping-jump"] >= 0.8 * count
