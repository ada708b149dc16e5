"""Directional force matrix H of the rotating cutter, and its integrals; conventions in `Cut`."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from lobes.cut import Cut
from modal.arrays import Complexes, Floats


def mean_force(cut: Cut) -> Floats:
    """Return the force matrix of all teeth averaged over a turn (Pa), shape (2, 2).

    H0 = N / (2 pi) times the integral of H. A helix does not change it.
    """
    return cut.teeth / (2 * np.pi) * _to_machine_axes(cut, _tooth_integral(cut, np.array(cut.exit_angle)))


def mean_damping(cut: Cut) -> Floats:
    """Return C / D times n n' of all teeth averaged over a turn (Pa), n the normal of the surface, shape (2, 2).

    The process damping per depth and velocity (N s/m^2) is 60 / (pi rpm) times as much.
    """
    return mean_force(replace(cut, radial=cut.process_damping)) - mean_force(replace(cut, radial=0.0))


@lru_cache(maxsize=64)
def interval_forces(cut: Cut, intervals: int) -> Floats:
    """Return the force matrix per depth of straight teeth, averaged over each interval of the pitch pattern.

    Separately for the teeth of each delay; the pattern is one tooth period of even teeth. Pa, shape
    (delays, intervals, 2, 2).
    """
    step = sum(cut.pitch_pattern) / intervals
    edges = cut.lead_angles[:, np.newaxis] + step * np.arange(intervals + 1)
    forces = _to_machine_axes(cut, _sum_by_delay(cut, np.diff(_tooth_integral(cut, edges), axis=1))) / step
    forces.flags.writeable = False
    return np.asarray(forces)


def mean_regeneration(cut: Cut, waves: Floats, kind: type[np.floating[Any]] = np.float64) -> Complexes:
    """Return 1 - exp(-i w tau) averaged over all teeth, for waves in the mean tooth period (...).

    kind: precision of sine and cosine. Single precision is several times faster.
    """
    gain = np.zeros(waves.shape, np.complex128)
    for delay in np.array(cut.pitch_pattern) / (2 * np.pi / cut.teeth):
        turn = waves * delay
        half = (np.pi * (turn - np.rint(turn))).astype(kind)
        sine, cosine = np.sin(half), np.cos(half)
        gain.real += 2 * sine**2
        gain.imag += 2 * sine * cosine
    return gain / len(cut.pitch_pattern)


def force_shares(cut: Cut, angle: Floats, depth: Floats) -> Floats:
    """Return the force matrix per depth in the frame of the feed, for Kt = 1 only and for Kr = 1 only.

    Separately for the teeth of each delay. angle: of the first tooth since its entry at the tip (rad), shape
    (..., s); depth (...) in m matters for helical teeth, whose force is the mean along the axis. Returns shape
    (delays, ..., s, 2, 2, 2), the coefficient before the matrix. Not defined at an angle where a tooth enters or
    leaves.
    """
    tooth = cut.entry_angle + angle + cut.lead_angles.reshape(-1, *np.ones(angle.ndim, dtype=int))
    if cut.helix_lag == 0:
        inside = (np.mod(tooth, 2 * np.pi) > cut.entry_angle) & (np.mod(tooth, 2 * np.pi) < cut.exit_angle)
        cuts = inside.astype(np.float64)
        shares = _force_terms(cuts, cuts * np.sin(2 * tooth), cuts * np.cos(2 * tooth))
    else:
        lag = np.maximum(cut.helix_lag * np.broadcast_to(depth[..., np.newaxis], tooth.shape), 1e-9)
        shares = (_tooth_integral(cut, tooth) - _tooth_integral(cut, tooth - lag)) / _append_axes(lag)
    return _sum_by_delay(cut, shares)


def rotate_to_machine(matrix: Floats, feed_angle: Floats) -> Floats:
    """Rotate matrices from the frame of the feed (..., 2, 2) to machine axes; feed_angle (rad) broadcasts."""
    turn = feed_rotation(feed_angle)
    return np.asarray(np.swapaxes(turn, -1, -2) @ matrix @ turn)


def feed_rotation(feed_angle: Floats) -> Floats:
    """Return the rotation of displacements from machine axes to the frame of the feed, shape (..., 2, 2)."""
    c, s = np.cos(feed_angle), np.sin(feed_angle)
    return np.stack((np.stack((c, s), axis=-1), np.stack((-s, c), axis=-1)), axis=-2)


def _to_machine_axes(cut: Cut, shares: Floats) -> Floats:
    """Return the matrix of a cut (Pa) from the shares of its two coefficients."""
    matrix = cut.tangential * shares[..., 0, :, :] + cut.radial * shares[..., 1, :, :]
    return rotate_to_machine(matrix, np.array(cut.feed_angle))


def _sum_by_delay(cut: Cut, shares: Floats) -> Floats:
    """Sum values of each tooth (teeth, ...) over those of one delay, shape (delays, ...)."""
    if not cut.pitch:
        return np.asarray(shares.sum(axis=0, keepdims=True))
    return np.stack([shares[np.array(cut.pitch) == delay].sum(axis=0) for delay in cut.delays])


def _tooth_integral(cut: Cut, angle: Floats) -> Floats:
    """Integrate H of one tooth from angle 0 for both coefficients, shape (..., 2, 2, 2)."""
    turns, remainder = np.divmod(angle, 2 * np.pi)
    inside = np.clip(remainder, cut.entry_angle, cut.exit_angle)
    start, end = _full_turn_integral(np.array(cut.entry_angle)), _full_turn_integral(np.array(cut.exit_angle))
    return _full_turn_integral(inside) - start + _append_axes(turns) * (end - start)


def _full_turn_integral(angle: Floats) -> Floats:
    """Integrate H from 0 to any angle, as if the tooth were always in the cut."""
    return _force_terms(angle, -np.cos(2 * angle) / 2, np.sin(2 * angle) / 2)


def _force_terms(one: Floats, sine: Floats, cosine: Floats) -> Floats:
    """Return H from its terms 1, sin 2 phi and cos 2 phi: s^2 = (1 - cos 2 phi) / 2, c^2 = (1 + cos 2 phi) / 2."""
    tangential = [[sine, one + cosine], [-(one - cosine), -sine]]
    radial = [[one - cosine, sine], [sine, one + cosine]]
    return np.moveaxis(np.array([tangential, radial]), (0, 1, 2), (-3, -2, -1)) / 2


def _append_axes(values: Floats) -> Floats:
    return np.asarray(values)[..., np.newaxis, np.newaxis, np.newaxis]
