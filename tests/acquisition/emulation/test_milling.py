"""Milling in the time domain against harmonic balance, Floquet multipliers, a plain simulation, and symmetries."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from milling_steps import Case
from numpy.typing import NDArray
from plain_milling import plain_cut
from turn_repetition import nonperiodic_share

from acquisition.emulation import MillingCut, Passage, Structure, TipMotion, simulate_cut, simulate_cuts
from lobes import Cut, spectral_radius, stability_boundary
from modal import Mode

Floats = NDArray[np.float64]
X = ((603.0, 0.039, 5.59e6),)
Y = ((666.0, 0.035, 5.715e6),)
STEADY = Passage(before=0.0, ramp=0.05, steady=0.6, after=0.0)


def structure(modes: tuple[tuple[float, float, float], ...]) -> Structure:
    return Structure(*np.array(modes).T)


STEPS = 160
"""Steps of the plain simulation per tooth period."""


def cut_of(cut: Cut, speed_rpm: float, depth: float, **changes: Any) -> MillingCut:
    made = MillingCut(
        teeth=cut.teeth,
        entry_angle=cut.entry_angle,
        exit_angle=cut.exit_angle,
        tangential=cut.tangential,
        radial=cut.radial,
        depth=depth,
        feed_per_tooth=1e-4,
        speed_rpm=speed_rpm,
        x=structure(X),
        y=structure(Y),
    )
    return replace(made, **changes)


HALF_UP = Cut(3, 0.5, "up", 6e8, 0.42e8)
DOWN = Cut(2, 0.6, "down", 6e8, 2e8)


def middle(motion: TipMotion, seconds: float, end: float = 0.64) -> Floats:
    """Return the acceleration over the last whole numbers of samples before `end` (s)."""
    last, n = round(end * motion.sample_rate), round(seconds * motion.sample_rate)
    return motion.acceleration[:, last - n : last]


def receptance(modes: tuple[tuple[float, float, float], ...], omega: NDArray[Any]) -> NDArray[Any]:
    total = np.zeros(omega.shape, dtype=complex)
    for f, zeta, k in modes:
        r = omega / (2 * np.pi * f)
        total += 1 / (k * (1 - r**2 + 2j * zeta * r))
    return total


def balanced(cut: MillingCut, points: int) -> Floats:
    """Return the acceleration (2, points) over a turn of a stable cut along x in permanent contact, by collocation."""
    omega = 2 * np.pi * np.fft.fftfreq(points, 60 / cut.speed_rpm / points)
    half = np.pi / points
    turn = 2 * half * (np.arange(points) + 0.5)
    compliance, inverse = np.zeros((2, points, points)), np.fft.ifft(np.eye(points), axis=0)
    for axis, modes in enumerate((X, Y)):
        compliance[axis] = np.real(
            inverse @ (receptance(modes, omega)[:, np.newaxis] * np.fft.fft(np.eye(points), axis=0))
        )
    late = np.roll(np.eye(points), points // cut.teeth, axis=0)
    slope, constant = np.zeros((2, 2, points)), np.zeros((2, points))
    for tooth in range(cut.teeth):
        angle = np.mod(turn - 2 * np.pi * tooth / cut.teeth, 2 * np.pi)
        begin, end = np.maximum(angle - half, cut.entry_angle), np.minimum(angle + half, cut.exit_angle)
        inside = np.clip((end - begin) / (2 * half), 0, 1)
        s, c = np.sin(angle), np.cos(angle)
        force = (
            -cut.depth * inside * np.array([cut.tangential * c + cut.radial * s, cut.radial * c - cut.tangential * s])
        )
        ahead = cut.runout[tooth] - cut.runout[tooth - 1]
        constant += force * (cut.feed_per_tooth * s + ahead)
        constant -= cut.depth * inside * (cut.tangential_edge * np.array([c, -s]) + cut.radial_edge * np.array([s, c]))
        slope += force[:, np.newaxis] * np.array([s, c])
    matrix = np.eye(2 * points).reshape(2, points, 2, points)
    for i in (0, 1):
        for j in (0, 1):
            matrix[i, :, j] -= compliance[i] @ (slope[i, j][:, np.newaxis] * (np.eye(points) - late))
    pushed = np.concatenate([compliance[i] @ constant[i] for i in (0, 1)])
    place = np.linalg.solve(matrix.reshape(2 * points, 2 * points), pushed).reshape(2, points)
    return np.real(np.fft.ifft(-(omega**2) * np.fft.fft(place)))


@pytest.mark.parametrize(("runout", "edge"), [((0.0, 0.0), 4e5), ((8e-6, -8e-6), 0.0)])
def test_a_stable_cut_vibrates_as_harmonic_balance_says(runout: tuple[float, float], edge: float) -> None:
    wide = cut_of(Cut(2, 1.0, "up", 6e8, 2e8), 6000.0, 0.4e-3, feed_per_tooth=1e-3, runout=runout)
    cut = replace(wide, entry_angle=0.6, exit_angle=2.2, tangential_edge=edge, radial_edge=edge / 2)
    exact = np.abs(np.fft.rfft(balanced(cut, 256))[:, 1:13]) / 256
    motion = simulate_cut(cut, Passage(0.0, 0.05, 0.45, 0.0))
    turns = middle(motion, 0.1, end=0.45)
    found = np.abs(np.fft.rfft(turns)[:, 10:121:10]) / turns.shape[1]
    assert found == pytest.approx(exact, rel=0.02, abs=5e-4 * float(np.max(exact)))
    assert (np.max(found[:, ::2]) > 0.02 * np.max(found)) == (runout[0] != 0)


def multiplier(cut: MillingCut, motion: TipMotion, passage: Passage) -> float:
    """Return the growth per tooth period of the part that does not repeat with the teeth, while it is small."""
    steps = round(cut.tooth_period * motion.sample_rate)
    assert cut.tooth_period * motion.sample_rate == pytest.approx(steps)
    first = round((passage.before + passage.ramp) * motion.sample_rate) + steps
    n = round((passage.steady - 0.01) * motion.sample_rate) // steps - 1
    teeth = motion.acceleration[:, first : first + n * steps].reshape(2, n, steps).astype(float)
    change = np.sqrt(np.sum(np.diff(teeth, axis=1) ** 2, axis=(0, 2)) / np.sum(teeth[:, 0] ** 2))
    small = np.log(change[(change < 0.02) & (change > 1e-5)])
    late = small[small.size // 2 :]
    assert late.size >= 12
    half = late.size // 2
    return float(np.exp((np.mean(late[-half:]) - np.mean(late[:half])) / (late.size - half)))


@pytest.mark.parametrize(
    ("cut", "speed_rpm"),
    [(DOWN, 9000.0), (Cut(1, 0.1, "up", 6e8, 2e8), 17000.0)],
)
def test_it_dies_below_the_limit_and_grows_above_it_as_the_multipliers_say(cut: Cut, speed_rpm: float) -> None:
    x, y = [Mode(*X[0])], [Mode(*Y[0])]
    limit = float(stability_boundary(x, y, cut, [speed_rpm], 0.05).depth[0])
    depths = [0.9 * limit, 1.1 * limit]
    exact = spectral_radius(x, y, cut, [speed_rpm], depths)[0]
    assert exact[0] < 1 < exact[1]
    for depth, ramp, expected in zip(depths, (0.01, 0.4), exact, strict=True):
        made, passage = cut_of(cut, speed_rpm, depth), Passage(0.0, ramp, 0.4, 0.0)
        motion = simulate_cut(made, passage)
        assert multiplier(made, motion, passage) - 1 == pytest.approx(expected - 1, rel=0.1)
        assert (nonperiodic_share(motion, made, passage) > 1e-2) == (expected > 1)


def test_chatter_has_the_frequency_of_the_lobes() -> None:
    boundary = stability_boundary([Mode(*X[0])], [Mode(*Y[0])], HALF_UP, [7000.0], 0.05)
    motion = simulate_cut(cut_of(HALF_UP, 7000.0, 1.05 * float(boundary.depth[0])), STEADY)
    steady = middle(motion, 0.4)[1]
    spectrum = np.abs(np.fft.rfft(steady * np.hanning(steady.size)))
    frequency = np.fft.rfftfreq(steady.size, 1 / motion.sample_rate)
    spectrum[np.abs(frequency / 350 - np.rint(frequency / 350)) * 350 < 8] = 0
    assert frequency[np.argmax(spectrum)] == pytest.approx(float(boundary.chatter_frequency[0]), rel=0.01)


@pytest.mark.parametrize(
    ("cut", "speed_rpm", "depth"),
    [
        (Cut(3, 0.2, "down", 6e8, 0.42e8), 9000.0, 5e-3),
        pytest.param(HALF_UP, 7000.0, 2.5e-3, marks=pytest.mark.long),
    ],
)
def test_chatter_with_loss_of_contact_is_as_large_as_in_a_plain_simulation(
    cut: Cut, speed_rpm: float, depth: float
) -> None:
    """Check a tooth that leaves the cut and meets the surface left several tooth periods ago."""
    made = cut_of(cut, speed_rpm, depth)
    case = Case(X, Y, 0.0, cut.teeth, cut.immersion, cut.direction, cut.tangential, cut.radial, 0.0, speed_rpm, depth)
    plain = np.ravel(plain_cut(case, STEPS, 120).motion[-80:]) * made.feed_per_tooth
    motion = simulate_cut(made, STEADY)
    assert displacement(middle(motion, 0.25)[0], 1 / motion.sample_rate) == pytest.approx(
        displacement(plain, made.tooth_period / STEPS, already=True), rel=0.04
    )


def displacement(signal: Floats, step: float, already: bool = False) -> float:
    """Return the rms displacement (m) between 100 and 2000 Hz, from acceleration or displacement."""
    spectrum = np.fft.rfft((signal - np.mean(signal)) * np.hanning(signal.size)) / signal.size
    frequency = np.fft.rfftfreq(signal.size, step)
    band = (frequency > 100) & (frequency < 2000)
    omega = np.ones(1) if already else (2 * np.pi * frequency[band]) ** 2
    return float(np.sqrt(np.sum(np.abs(spectrum[band] / omega) ** 2)))


def test_a_quarter_turn_of_the_feed_swaps_the_axes() -> None:
    cut = cut_of(HALF_UP, 7000.0, 2e-3, feed_angle=0.3, runout=(3e-6, 0.0, -5e-6))
    turned = replace(cut, x=cut.y, y=cut.x, feed_angle=0.3 + math.pi / 2)
    motions = dict(simulate_cuts([cut, turned], Passage(0.0, 0.02, 0.1, 0.0)))
    size = float(np.max(np.abs(motions[0].acceleration)))
    assert motions[1].acceleration[1] == pytest.approx(motions[0].acceleration[0], abs=1e-3 * size)
    assert motions[1].acceleration[0] == pytest.approx(-motions[0].acceleration[1], abs=1e-3 * size)


def test_a_helix_of_one_pitch_cuts_with_the_same_force_at_all_times() -> None:
    straight = cut_of(HALF_UP, 7000.0, 0.5e-3)
    helical = replace(straight, helix_lag=2 * math.pi / 3 / straight.depth)
    motions = dict(simulate_cuts([straight, helical], STEADY))
    straight_rms, helical_rms = (float(np.std(middle(motions[i], 0.3))) for i in (0, 1))
    assert helical_rms < 0.02 * straight_rms


def test_before_the_cut_the_tip_rests_and_after_it_rings_down() -> None:
    passage = Passage(before=0.1, ramp=0.03, steady=0.2, after=0.3)
    motion = simulate_cut(cut_of(HALF_UP, 7000.0, 1e-3), passage)
    time = (np.arange(motion.acceleration.shape[1]) + 0.5) / motion.sample_rate
    assert time[-1] == pytest.approx(passage.before + passage.cutting + passage.after, abs=1e-4)
    loud = [
        np.max(np.abs(motion.acceleration[:, (time > a) & (time < b)])) for a, b in ((0, 0.1), (0.15, 0.3), (0.6, 0.7))
    ]
    assert loud[0] == 0
    assert 0 < loud[2] < 1e-6 * loud[1]
    ends = np.flatnonzero(time > passage.before + passage.cutting)[0]
    assert np.max(np.abs(motion.acceleration[:, ends : ends + 200])) > 1e-3 * loud[1]


def test_a_cut_among_others_is_the_same_as_alone() -> None:
    """Check a second cut with more teeth, padded by zeros of the first."""
    cuts = [cut_of(HALF_UP, 7000.0, 1e-3), cut_of(replace(HALF_UP, teeth=4, immersion=0.9), 5250.0, 1e-3, y=None)]
    together = dict(simulate_cuts(cuts, Passage(0.0, 0.02, 0.1, 0.05)))
    for number, cut in enumerate(cuts):
        alone = simulate_cut(cut, Passage(0.0, 0.02, 0.1, 0.05))
        assert together[number].acceleration == pytest.approx(alone.acceleration, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize(
    "change",
    [
        {"teeth": 0},
        {"entry_angle": 2.0, "exit_angle": 1.0},
        {"depth": 0.0},
        {"speed_rpm": math.inf},
        {"radial": -1.0},
        {"runout": (1e-6,)},
        {"x": None, "y": None},
    ],
)
def test_what_is_no_cut_is_rejected(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"teeth|angle|depth|radial|runout|rigid"):
        replace(cut_of(HALF_UP, 7000.0, 1e-3), **change)


def test_a_passage_without_a_cut_is_rejected() -> None:
    with pytest.raises(ValueError, match="ramp or steady"):
        Passage(ramp=0.0, steady=0.0)


def test_pitches_that_are_alike_are_even_teeth() -> None:
    even = cut_of(HALF_UP, 7000.0, 1e-3, runout=(3e-6, 0.0, -5e-6), helix_lag=60.0)
    passage = Passage(before=0.0, ramp=0.02, steady=0.2, after=0.0)
    motion, same = (simulate_cut(cut, passage) for cut in (even, replace(even, pitch=(2 * math.pi / 3,) * 3)))
    spectra = [
        np.abs(np.fft.rfft(middle(one, 60 / 7000 * 10, end=0.21), axis=1))[:, 10:160:10] / one.sample_rate
        for one in (motion, same)
    ]
    assert spectra[1] == pytest.approx(spectra[0], rel=0.03, abs=0.01 * float(np.max(spectra[0])))


@pytest.mark.parametrize(("pitch", "speed"), [((80, 100, 80, 100), 6600.0), ((75, 85, 95, 105), 5200.0)])
def test_uneven_teeth_chatter_beyond_their_limit_and_not_below(pitch: tuple[float, ...], speed: float) -> None:
    cut = Cut(4, 1.0, "down", 6e8, 2e8, pitch=tuple(np.radians(pitch)))
    x, y = ([Mode(*one) for one in side] for side in (X, Y))
    limit, even = (
        float(stability_boundary(x, y, one, [speed], 0.03).depth[0]) for one in (cut, replace(cut, pitch=()))
    )
    assert limit > 1.3 * even
    passage, made = (
        Passage(0.0, 0.02, 0.5, 0.0),
        [cut_of(cut, speed, side * limit, pitch=cut.pitch) for side in (0.94, 1.06)],
    )
    below, above = (nonperiodic_share(simulate_cut(one, passage), one, passage) for one in made)
    assert below < 0.01 < 0.3 < above


@pytest.mark.parametrize("pitch", [(1.0, 2.0), (2.0, 2.0, 2.0), (-1.0, 3.0, 2 * math.pi - 2.0)])
def test_pitches_that_are_none_are_rejected(pitch: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"pitch=.* 3 "):
        cut_of(HALF_UP, 7000.0, 1e-3, pitch=pitch)
