"""Which frequency of a multiplier's family a chattering cut sounds with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.milling_system import MillingSystem
from lobes.tooth_force import interval_forces, mean_force

HIGHEST = 2.0
"""Frequencies are looked for up to this many times the highest natural frequency, and three tooth frequencies."""
NEIGHBOURS = 4
"""Tooth frequencies on each side that count in the balance of harmonics."""
SAMPLES = 128
"""Intervals of a tooth period from which the harmonics of the cutting force are taken."""

Floats = NDArray[np.float64]


def chatter_frequency(
    system: MillingSystem, cut: Cut, multiplier: NDArray[np.complex128], depth: Floats, tooth_frequency: Floats
) -> Floats:
    """The loudest frequency (Hz) at limits with these multipliers (|mu| = 1), depths (m) and tooth frequencies (n,).

    A multiplier leaves |+-arg(mu) / (2 pi) + j| tooth frequencies, j whole. First that one is taken which comes nearest
    to closing the loop of the mean force, then the loudest in the balance of harmonics around it,
    d_k = -b (1 - 1/mu) G_k sum_l H_(k-l) d_l.
    """
    waves = _nearest_to_mean_force(system, cut, multiplier, depth, tooth_frequency)[:, np.newaxis]
    harmonics = waves + np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
    frequency = harmonics * tooth_frequency[:, np.newaxis]
    gain = -depth[:, np.newaxis] * (1 - np.exp(-2j * np.pi * waves))
    receptance = gain[..., np.newaxis] * system.receptance(frequency)
    balance = receptance[:, :, np.newaxis, :, np.newaxis] * _force_harmonics(system, cut)
    size = harmonics.shape[1] * system.axes.size
    values, vectors = np.linalg.eig(balance.transpose(0, 1, 3, 2, 4).reshape(-1, size, size))
    row = np.arange(depth.size)
    amplitude = np.abs(vectors[row, :, np.argmin(np.abs(values - 1), axis=1)]).reshape(*harmonics.shape, -1)
    loudest = np.argmax(np.linalg.norm(amplitude, axis=-1), axis=1)
    return np.asarray(np.abs(frequency[row, loudest]))


def _nearest_to_mean_force(
    system: MillingSystem, cut: Cut, multiplier: NDArray[np.complex128], depth: Floats, tooth_frequency: Floats
) -> Floats:
    """Waves between two teeth of the frequency with the least |det(I + b (1 - exp(-i w tau)) H0 G(w))|, shape (n,)."""
    base = np.abs(np.angle(multiplier))[:, np.newaxis] / (2 * np.pi)
    highest = HIGHEST * float(np.max(system.frequency)) / (2 * np.pi)
    whole = np.arange(int(highest / np.min(tooth_frequency)) + 3)
    waves = np.concatenate((whole + base, whole + 1 - base), axis=1)
    gain = depth[:, np.newaxis] * (1 - np.exp(-2j * np.pi * waves))
    force = mean_force(cut)[np.ix_(system.axes, system.axes)]
    receptance = system.receptance(waves * tooth_frequency[:, np.newaxis])[..., np.newaxis, :]
    loop = np.eye(system.axes.size) + gain[..., np.newaxis, np.newaxis] * force * receptance
    best = np.argmin(np.abs(np.linalg.det(loop)), axis=1)[:, np.newaxis]
    return np.take_along_axis(waves, best, axis=1)[:, 0]


def _force_harmonics(system: MillingSystem, cut: Cut) -> NDArray[np.complex128]:
    """Harmonics H_(k-l) of the force matrix at the tooth frequency, shape (h, h, p, p)."""
    forces = interval_forces(cut, SAMPLES)[:, system.axes[:, np.newaxis], system.axes]
    harmonics = np.fft.fft(forces, axis=0) / SAMPLES
    order = np.arange(2 * NEIGHBOURS + 1)
    return np.asarray(harmonics[order[:, np.newaxis] - order])
