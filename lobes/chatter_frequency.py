"""Which frequency of a multiplier's family a chattering cut sounds with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.milling_system import MillingSystem
from lobes.tooth_force import interval_forces, mean_force, mean_regeneration

HIGHEST = 2.0
"""Frequencies are looked for up to this many times the highest natural frequency, and three tooth frequencies."""
NEIGHBOURS = 4
"""Tooth frequencies on each side that count in the balance of harmonics."""
SAMPLES = 128
"""Intervals of a tooth period from which the harmonics of the cutting force are taken."""

Floats = NDArray[np.float64]


def chatter_frequency(
    system: MillingSystem, cut: Cut, multiplier: NDArray[np.complex128], depth: Floats, base: Floats
) -> Floats:
    """The loudest frequency (Hz) at limits with these multipliers (|mu| = 1) and depths (m), each of shape (n,).

    base (n,): frequency at which the cut repeats (Hz), the tooth frequency of even teeth. A multiplier leaves
    |+-arg(mu) / (2 pi) + j| times base, j whole. First that one is taken which comes nearest to closing the loop of the
    mean force, then the loudest in the balance of harmonics around it, over the delays tau,
    d_k = -b G_k sum_l sum_tau H_(tau, k-l) (1 - exp(-i w_l tau)) d_l.
    """
    waves = _nearest_to_mean_force(system, cut, multiplier, depth, base)[:, np.newaxis]
    reach = NEIGHBOURS * len(cut.pattern)
    harmonics = waves + np.arange(-reach, reach + 1)
    frequency = harmonics * base[:, np.newaxis]
    receptance = -depth[:, np.newaxis, np.newaxis, np.newaxis] * system.receptance(frequency)
    regenerated = 1 - np.exp(-2j * np.pi * harmonics[..., np.newaxis] * _delays(cut))
    forces = np.einsum("gklpq,nlg->nkplq", _force_harmonics(system, cut, harmonics.shape[1]), regenerated)
    balance = np.einsum("gkpr,gkrlq->gkplq", receptance, forces)
    size = harmonics.shape[1] * system.axes.size
    values, vectors = np.linalg.eig(balance.reshape(-1, size, size))
    row = np.arange(depth.size)
    amplitude = np.abs(vectors[row, :, np.argmin(np.abs(values - 1), axis=1)]).reshape(*harmonics.shape, -1)
    loudest = np.argmax(np.linalg.norm(amplitude, axis=-1), axis=1)
    return np.asarray(np.abs(frequency[row, loudest]))


def _nearest_to_mean_force(
    system: MillingSystem, cut: Cut, multiplier: NDArray[np.complex128], depth: Floats, base: Floats
) -> Floats:
    """Multiple of base with the least |det(I + b s H0 G(w))|, s the mean of 1 - exp(-i w tau), shape (n,)."""
    part = np.abs(np.angle(multiplier))[:, np.newaxis] / (2 * np.pi)
    highest = HIGHEST * float(np.max(system.frequency)) / (2 * np.pi)
    whole = np.arange(int(highest / np.min(base)) + 3 * len(cut.pattern))
    waves = np.concatenate((whole + part, whole + 1 - part), axis=1)
    gain = depth[:, np.newaxis] * mean_regeneration(cut, waves / len(cut.pattern))
    force = mean_force(cut)[np.ix_(system.axes, system.axes)]
    receptance = system.receptance(waves * base[:, np.newaxis])
    loop = np.eye(system.axes.size) + gain[..., np.newaxis, np.newaxis] * (force @ receptance)
    best = np.argmin(np.abs(np.linalg.det(loop)), axis=1)[:, np.newaxis]
    return np.take_along_axis(waves, best, axis=1)[:, 0]


def _delays(cut: Cut) -> Floats:
    """Delays over the time after which the cut repeats, shape (delays,)."""
    return np.array(cut.delays) / sum(cut.pattern)


def _force_harmonics(system: MillingSystem, cut: Cut, number: int) -> NDArray[np.complex128]:
    """Harmonics H_(k-l) of the force matrix of the teeth of each delay, shape (delays, number, number, p, p)."""
    samples = SAMPLES * len(cut.pattern)
    forces = interval_forces(cut, samples)[..., system.axes[:, np.newaxis], system.axes]
    harmonics = np.fft.fft(forces, axis=1) / samples
    order = np.arange(number)
    return np.asarray(harmonics[:, order[:, np.newaxis] - order])
