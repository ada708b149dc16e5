"""Stepped round beams: two equal halves, d2/d1 = 0.5 or 2, first half EI = m = 1, total length 1.

References: determinant of the exact 8x8 boundary-value problem, roots in 40-digit arithmetic.
"""

from __future__ import annotations

import math
from importlib import import_module

import numpy as np
import pytest

from dsm import Bearing, Segment, Spindle, natural_frequencies
from dsm.matrix.assemble import HeldDof
from dsm.modes.find_modes import find_modes

CLAMPED: list[HeldDof] = [(0.0, 0), (0.0, 1)]
PINS: list[HeldDof] = [(0.0, 0), (1.0, 0)]


def stepped(ratio: float) -> Spindle:
    first = Segment(0.5, 1.0)
    return Spindle([first, Segment(0.5, ratio)], [], 1 / first.second_moment, 1 / first.area)


@pytest.mark.parametrize(
    ("ratio", "held", "expected"),
    [
        (0.5, CLAMPED, [5.0699767913306, 14.750962122423, 44.080605409899]),
        (0.5, PINS, [4.676910691946, 29.522319939641, 59.861227727785]),
        (2.0, CLAMPED, [1.8396610001457, 19.961210520957, 88.999060356477]),
        (2.0, [*CLAMPED, (1.0, 0), (1.0, 1)], [29.339330750263, 88.951923283997]),
    ],
)
def test_stepped_beam(ratio: float, held: list[HeldDof], expected: list[float]) -> None:
    modes = find_modes(stepped(ratio), len(expected), held=held)
    assert 2 * math.pi * modes.frequency == pytest.approx(expected, rel=2e-11)


@pytest.mark.parametrize("pins", [4, 8, 12, 16])
def test_modes_that_all_but_coincide_are_both_found(pins: int) -> None:
    """Two overhangs joined through many pins: the halves with a symmetric or antisymmetric cut give both modes."""
    overhang, gap = 1.0, 0.1
    places = [overhang + gap * i for i in range(pins)]
    length = 2 * overhang + gap * (pins - 1)
    whole = Spindle([Segment(length, 0.05)], [Bearing(z, 1e8) for z in places])
    half = Spindle([Segment(length / 2, 0.05)], [])
    held: list[HeldDof] = [(z, 0) for z in places if z < length / 2]
    symmetric = find_modes(half, 2, held=[*held, (length / 2, 1)]).frequency
    antisymmetric = find_modes(half, 2, held=[*held, (length / 2, 0)]).frequency
    found = natural_frequencies(whole, 4, rigid_bearings=True)
    assert found == pytest.approx(np.sort(np.concatenate([symmetric, antisymmetric])), rel=2e-11)


def test_bounce_and_pitch_of_one_frequency_are_both_found() -> None:
    """A stiff bar on springs at +-a bounces and pitches at one frequency for a = radius of gyration = L/sqrt(12)."""
    place = 0.5 / math.sqrt(3)
    bar = Spindle([Segment(1.0, 0.3)], [Bearing(0.5 - place, 1e4), Bearing(0.5 + place, 1e4)])
    expected = math.sqrt(2e4 / bar.mass) / (2 * math.pi)
    assert natural_frequencies(bar, 3)[:2] == pytest.approx([expected, expected], rel=1e-4)
    assert natural_frequencies(bar, 3)[2] > 100 * expected


def test_modes_are_right_when_the_iteration_goes_astray(monkeypatch: pytest.MonkeyPatch) -> None:
    """Iteration that ends twice in mode 2 and never in modes 1 and 4 is found out and mended by counting."""
    spindle = Spindle(
        [Segment(0.2, 0.05), Segment(0.3, 0.08), Segment(0.1, 0.03)], [Bearing(0.15, 2e8), Bearing(0.4, 3e8)]
    )
    expected = find_modes(spindle, 5)

    def astray(model: object, w2: np.ndarray, shape: np.ndarray, width: object) -> tuple[np.ndarray, np.ndarray]:
        w2 = (2 * np.pi * expected.frequency) ** 2
        return w2[[1, 1, 2, 4, 4]], shape + 1e-3

    monkeypatch.setattr(import_module("dsm.modes.find_modes"), "_refine_modes", astray)
    found = find_modes(spindle, 5)
    assert found.frequency == pytest.approx(expected.frequency, rel=1e-9)
    assert found.stiffness_at(0.0)[[0, 3]] == pytest.approx(expected.stiffness_at(0.0)[[0, 3]], rel=1e-6)
