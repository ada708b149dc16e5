"""Random spindles with parts anywhere, some of them nanometres apart: none refused, no mode missed.

The determinant of 50-digit transfer matrices changes its sign at each mode of a shaft and nowhere else: its sign
half-way between modes says whether their numbers are even or odd.
"""

from __future__ import annotations

import numpy as np
import pytest
from transfer_matrices import determinant

from dsm import Bearing, Joint, LumpedMass, Segment, Spindle, Theory, natural_frequencies, static_stiffness

MODES = 6
CLOSEST = 2e-9
"""Least distance between two parts over the length of the shaft."""


def random_spindle(draw: np.random.Generator) -> Spindle:
    """Two to eight segments, two to six bearings, up to two masses and two joints; half of them beside others."""
    segments = [
        Segment(float(10 ** draw.uniform(-2.5, -0.8)), outer, float(draw.choice([0.0, 0.3, 0.7])) * outer)
        for outer in 10 ** draw.uniform(-1.6, -0.8, int(draw.integers(2, 9)))
    ]
    ends = np.cumsum([0.0, *(segment.length for segment in segments)])
    taken = ends.tolist()

    def place() -> float:
        while True:
            z = float(draw.uniform(0.0, ends[-1]))
            if draw.random() < 0.5:
                z = float(draw.choice(taken)) + float(draw.choice([-1, 1]) * 10 ** draw.uniform(-8.5, -3))
            if 0 <= z <= ends[-1] and np.min(np.abs(np.array(taken) - z)) > CLOSEST * ends[-1]:
                taken.append(z)
                return z

    bearings = [
        Bearing(
            place(),
            float(10 ** draw.uniform(6, 10)),
            housing_stiffness=float(draw.choice([np.inf, 10 ** draw.uniform(7, 10)])),
            rotational_stiffness=float(draw.choice([0.0, 10 ** draw.uniform(2, 6)])),
        )
        for _ in range(int(draw.integers(2, 7)))
    ]
    masses = [LumpedMass(place(), *(10 ** draw.uniform([-2, -6], [1, -2])).tolist()) for _ in range(draw.integers(3))]
    joints = [Joint(place(), *(10 ** draw.uniform([7, 4], [10, 7])).tolist()) for _ in range(draw.integers(3))]
    theory: Theory = "timoshenko" if draw.random() < 0.5 else "euler-bernoulli"
    return Spindle(segments, bearings, theory=theory, masses=masses, joints=joints)


def refused_and_missed(number: int, checked: int, seed: int) -> tuple[int, int]:
    """How many of `number` spindles are refused, and how many of the first `checked` have modes too few or too many."""
    draw, refused, missed = np.random.default_rng(seed), 0, 0
    for index in range(number):
        spindle = random_spindle(draw)
        try:
            frequency = natural_frequencies(spindle, MODES)
            static_stiffness(spindle)
        except ArithmeticError:
            refused += 1
            continue
        if index < checked:
            between = np.sqrt(np.append(frequency[0] / 4, frequency[:-1]) * frequency)
            signs = [float(np.sign(float(determinant(spindle, float(f))))) for f in between]
            missed += bool(np.any(np.diff(signs) == 0))
    return refused, missed


def test_twenty_random_spindles() -> None:
    assert refused_and_missed(20, 2, 7) == (0, 0)


@pytest.mark.long
def test_fifteen_hundred_random_spindles() -> None:
    assert refused_and_missed(1500, 100, 8) == (0, 0)
