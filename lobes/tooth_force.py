"""Integrals of the force matrix H over the turning cutter; H and the conventions stand in `Cut`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut

Floats = NDArray[np.float64]


def mean_force(cut: Cut) -> Floats:
    """Force matrix of all teeth averaged over a turn, H0 = N / (2 pi) times the integral of H (Pa), shape (2, 2).

    A helix does not change it.
    """
    return cut.teeth / (2 * np.pi) * _once(cut, np.array(cut.exit_angle))


def interval_forces(cut: Cut, intervals: int, depth: Floats) -> Floats:
    """Force matrix of all teeth per depth, averaged over each interval of a tooth period and along the axis.

    depth (c,) in m counts for helical teeth only. Returns Pa, shape (c, intervals, 2, 2).
    """
    step, edges = _edges(cut, intervals)
    lag = cut.helix_lag * np.asarray(depth, dtype=np.float64)
    straight = _straight(cut, intervals)
    forces = np.broadcast_to(straight, (lag.size, *straight.shape)).copy()
    for i in np.flatnonzero(lag > 0):
        along = _twice(cut, edges) - _twice(cut, edges - lag[i])
        forces[i] = np.diff(along, axis=1).sum(axis=0) / (step * lag[i])
    return forces


def _edges(cut: Cut, intervals: int) -> tuple[float, Floats]:
    """Angle of an interval, and the angles of all teeth where intervals begin and end, shape (teeth, intervals + 1)."""
    first = np.arange(cut.teeth)[:, np.newaxis] * 2 * np.pi / cut.teeth
    step = 2 * np.pi / (cut.teeth * intervals)
    return step, first + step * np.arange(intervals + 1)


@lru_cache(maxsize=64)
def _straight(cut: Cut, intervals: int) -> Floats:
    """Forces of straight teeth (Pa), shape (intervals, 2, 2); asked for again and again."""
    step, edges = _edges(cut, intervals)
    forces = np.diff(_once(cut, edges), axis=1).sum(axis=0) / step
    forces.flags.writeable = False
    return np.asarray(forces)


def _once(cut: Cut, angle: Floats) -> Floats:
    """Integral of H of one tooth from angle 0 (Pa), shape (..., 2, 2)."""
    turns, rest = np.divmod(angle, 2 * np.pi)
    inside = np.clip(rest, cut.entry_angle, cut.exit_angle)
    part = _matrices(cut, _integral(inside)) - _matrices(cut, _integral(np.array(cut.entry_angle)))
    return part + _expanded(turns) * _whole(cut)


def _twice(cut: Cut, angle: Floats) -> Floats:
    """Integral of `_once` from angle 0 (Pa), shape (..., 2, 2)."""
    turns, rest = np.divmod(angle, 2 * np.pi)
    whole, part = _whole(cut), _within_turn(cut, rest)
    turn = _within_turn(cut, np.array(2 * np.pi))
    before = 2 * np.pi * _expanded(turns * (turns - 1) / 2) * whole + _expanded(turns) * turn
    return part + before + _expanded(turns * rest) * whole


def _within_turn(cut: Cut, rest: Floats) -> Floats:
    """Integral of `_once` from 0 to an angle of the first turn (Pa), shape (..., 2, 2)."""
    start = np.array(cut.entry_angle)
    inside = np.clip(rest, cut.entry_angle, cut.exit_angle)
    part = _matrices(cut, _second_integral(inside)) - _matrices(cut, _second_integral(start))
    part = part - _expanded(inside - start) * _matrices(cut, _integral(start))
    return part + _expanded(np.maximum(rest - cut.exit_angle, 0)) * _whole(cut)


def _whole(cut: Cut) -> Floats:
    return _matrices(cut, _integral(np.array(cut.exit_angle))) - _matrices(cut, _integral(np.array(cut.entry_angle)))


def _integral(angle: Floats) -> tuple[Floats, Floats, Floats]:
    """Integrals of 1, sin 2 phi and cos 2 phi."""
    return angle, -np.cos(2 * angle) / 2, np.sin(2 * angle) / 2


def _second_integral(angle: Floats) -> tuple[Floats, Floats, Floats]:
    """Integrals of the integrals."""
    return angle**2 / 2, -np.sin(2 * angle) / 4, -np.cos(2 * angle) / 4


def _matrices(cut: Cut, parts: tuple[Floats, Floats, Floats]) -> Floats:
    """H from what stands for 1, sin 2 phi and cos 2 phi: s^2 = (1 - cos 2 phi) / 2, c^2 = (1 + cos 2 phi) / 2."""
    one, sine, cosine = parts
    kt, kr = cut.tangential / 2, cut.radial / 2
    rows = [
        [kt * sine + kr * (one - cosine), kt * (one + cosine) + kr * sine],
        [-kt * (one - cosine) + kr * sine, -kt * sine + kr * (one + cosine)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _expanded(values: Floats) -> Floats:
    return np.asarray(values)[..., np.newaxis, np.newaxis]
