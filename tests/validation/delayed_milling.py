"""Growth of milling with any pitch and any mode directions, by time stepping independent of `lobes`.

    F(t) = -b sum_j H_j(t) (q(t) - q(t - tau_j))

Each tooth has the delay of its own pitch, each mode an axis of its own. A turn has a whole number of steps, a pitch
too. Between steps the modes swing freely, which is exact; the force of a step acts as one impulse in its middle
(second order). Only small motion is followed: teeth do not leave the cut.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CYCLE = 90
"""Fewest steps in a cycle of the fastest mode."""
PARTS = 24
"""Places in a step over which a force is averaged."""
LAG = 0.01
"""Largest lag between two slices of a helical tooth (rad)."""
TURNS = 48
"""Turns before and over which growth is measured."""


@dataclass(frozen=True)
class DelayedCase:
    """A cut with x the feed and y the normal to it; the tooth angle runs clockwise from +y."""

    modes: tuple[tuple[float, float, float, float], ...]
    """Frequency (Hz), damping ratio, stiffness (N/m) and angle of its axis from x (rad) of each mode."""
    pitch: tuple[int, ...]
    """Angle by which each tooth follows the tooth before it (deg), whole degrees."""
    immersion: float
    direction: Literal["up", "down"]
    tangential: float
    radial: float
    helix_lag: float
    speed_rpm: float
    depth: float

    @property
    def arc(self) -> tuple[float, float]:
        """Angles where a tooth enters and leaves the cut (rad)."""
        if self.direction == "up":
            return 0.0, math.acos(1 - 2 * self.immersion)
        return math.acos(2 * self.immersion - 1), math.pi


def growth_per_turn(cases: Sequence[DelayedCase], seed: int = 0) -> Floats:
    """Logarithm by which the motion of each case grows in a turn, late in its life, shape (n,); above 0 it chatters."""
    cycles = max(mode[0] * 60 / case.speed_rpm for case in cases for mode in case.modes)
    steps = 360 * math.ceil(CYCLE * cycles / 360)
    most = max(len(case.modes) for case in cases)
    flight, shape, kick = (
        np.stack(part, axis=-1) for part in zip(*(_modal(c, steps, most) for c in cases), strict=True)
    )
    teeth = max(len(case.pitch) for case in cases)
    force = np.stack([_forces(case, steps, teeth) for case in cases], axis=-1)
    delay = np.zeros((teeth, len(cases)), dtype=np.int64)
    for i, case in enumerate(cases):
        delay[: len(case.pitch), i] = np.array(case.pitch) * steps // 360
    rng = np.random.default_rng(seed)
    swing = rng.normal(size=flight.shape) + 1j * rng.normal(size=flight.shape)
    history, column, sizes = np.zeros((steps, len(cases), 2)), np.arange(len(cases)), list[Floats]()
    for _ in range(2 * TURNS):
        for n in range(steps):
            swing *= flight
            d = np.einsum("imc,mc->ci", shape, swing.imag)
            chips = d - history[n - delay, column]
            history[n] = d
            swing -= np.einsum("imc,ic->mc", kick, np.einsum("eijc,ecj->ic", force[n], chips))
        size = np.sqrt(np.sum(history**2, axis=(0, 2)))
        sizes.append(np.log(size))
        if np.any(size > 1e100) or np.any(size < 1e-100):
            swing /= size
            history /= size[:, np.newaxis]
            sizes = [earlier - np.log(size) for earlier in sizes]
    late = np.array(sizes[TURNS:])
    return np.asarray(np.polynomial.polynomial.polyfit(np.arange(TURNS), late, 1)[1])


def _modal(case: DelayedCase, steps: int, most: int) -> tuple[NDArray[np.complex128], Floats, Floats]:
    """Flight (most,) over a step, axis (2, most) of each mode, and its kick (2, most) by a force over a step."""
    f, zeta, k, angle = np.array(case.modes).T
    w, step = 2 * np.pi * f, 60 / case.speed_rpm / steps
    damped = w * np.sqrt(1 - zeta**2)
    flight, shape, kick = np.zeros(most, dtype=complex), np.zeros((2, most)), np.zeros((2, most))
    flight[: f.size] = np.exp((-zeta * w + 1j * damped) * step)
    shape[:, : f.size] = np.cos(angle), np.sin(angle)
    kick[:, : f.size] = shape[:, : f.size] * step * w**2 / (k * damped)
    return flight, shape, kick


def _forces(case: DelayedCase, steps: int, teeth: int) -> Floats:
    """Depth times force matrix of each tooth in the mean of each step (N/m), shape (steps, teeth, 2, 2)."""
    fine = (np.arange(steps * PARTS) + 0.5) * 2 * np.pi / (steps * PARTS)
    slices = math.ceil(case.helix_lag * case.depth / LAG) if case.helix_lag else 1
    heights = (np.arange(slices) + 0.5) / slices * case.depth
    forces, entry = np.zeros((steps, teeth, 2, 2)), 0.0
    for j, pitch in enumerate(case.pitch):
        entry += math.radians(pitch) if j else 0.0
        for height in heights:
            phi = np.mod(case.arc[0] + fine - entry - case.helix_lag * height, 2 * np.pi)
            inside = (phi > case.arc[0]) & (phi < case.arc[1])
            s, c = np.sin(phi), np.cos(phi)
            along, across = case.tangential * c + case.radial * s, -case.tangential * s + case.radial * c
            matrix = np.array([[along * s, along * c], [across * s, across * c]]) * inside
            forces[:, j] += np.moveaxis(matrix.reshape(2, 2, steps, PARTS).mean(axis=-1), -1, 0)
    return forces * case.depth / heights.size
