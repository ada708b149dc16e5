"""Stability boundary over speed by semi-discretisation, and its chatter frequencies."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.coefficients import check_number
from lobes.cut import Cut
from lobes.floquet.crossings import converged_crossings, is_flip
from lobes.floquet.milling_rows import MillingRows, count_pieces, rows_at_speeds
from lobes.floquet.multipliers import largest_multipliers, spectral_radii
from lobes.milling_system import MillingSystem, build_milling_system
from lobes.stability_lobes import StabilityLobes, check_speeds, check_vector
from lobes.tip_response import TipModes
from lobes.tooth_force import interval_forces, mean_damping, mean_force, mean_regeneration
from modal.arrays import Complexes, Floats, Integers

MAX_CHATTER_FREQUENCY_RATIO = 2.0
"""Highest searched frequency over the highest natural frequency, to which three tooth frequencies are added."""
BALANCE_HARMONICS = 4
"""Tooth frequencies on each side in the balance of harmonics."""
FORCE_HARMONIC_SAMPLES = 128
"""Intervals of a tooth period for the harmonics of the cutting force."""


def loudest_chatter_frequency(system: MillingSystem, cut: Cut, mu: Complexes, depth: Floats, base: Floats) -> Floats:
    """Return the dominant frequency (Hz) at limits with multipliers |mu| = 1 and depths (m), each of shape (n,).

    base (n,): frequency at which the cut repeats (Hz), the tooth frequency of even teeth. A multiplier leaves
    |+-arg(mu) / (2 pi) + j| times base, j whole. The first choice nearly closes the loop of the
    mean force. The result is the largest in the balance of harmonics around it, over the delays tau,
    d_k = -b G_k sum_l (sum_tau H_(tau, k-l) (1 - exp(-i w_l tau)) + i w_l C / V N_(k-l)) d_l.
    """
    waves = _nearest_to_mean_force_loop(system, cut, mu, depth, base)[:, np.newaxis]
    reach = BALANCE_HARMONICS * len(cut.pitch_pattern)
    harmonics = waves + np.arange(-reach, reach + 1)
    frequency = harmonics * base[:, np.newaxis]
    receptance = -depth[:, np.newaxis, np.newaxis, np.newaxis] * system.receptance(frequency)
    delays = np.array(cut.delays) / sum(cut.pitch_pattern)
    regenerated = 1 - np.exp(-2j * np.pi * harmonics[..., np.newaxis] * delays)
    forces = np.einsum("gklpq,nlg->nkplq", _force_harmonics(system, cut, harmonics.shape[1]), regenerated)
    if cut.process_damping:
        normal = _damping_harmonics(system, cut, harmonics.shape[1])
        rate = 2j * cut.repeats_per_turn * harmonics  # i w C / V over C / D
        forces = forces + np.einsum("klpq,nl->nkplq", normal, rate)
    balance = np.einsum("gkpr,gkrlq->gkplq", receptance, forces)
    size = harmonics.shape[1] * system.axes.size
    values, vectors = np.linalg.eig(balance.reshape(-1, size, size))
    row = np.arange(depth.size)
    amplitude = np.abs(vectors[row, :, np.argmin(np.abs(values - 1), axis=1)]).reshape(*harmonics.shape, -1)
    loudest = np.argmax(np.linalg.norm(amplitude, axis=-1), axis=1)
    return np.asarray(np.abs(frequency[row, loudest]))


def _nearest_to_mean_force_loop(system: MillingSystem, cut: Cut, mu: Complexes, depth: Floats, base: Floats) -> Floats:
    """Return the multiple of base with the least |det(I + b s H0 G(w))|, s the mean of 1 - exp(-i w tau), (n,)."""
    part = np.abs(np.angle(mu))[:, np.newaxis] / (2 * np.pi)
    highest = MAX_CHATTER_FREQUENCY_RATIO * float(np.max(system.frequency)) / (2 * np.pi)
    whole = np.arange(int(highest / np.min(base)) + 3 * len(cut.pitch_pattern))
    waves = np.concatenate((whole + part, whole + 1 - part), axis=1)
    gain = depth[:, np.newaxis] * mean_regeneration(cut, waves / len(cut.pitch_pattern))
    both = np.ix_(system.axes, system.axes)
    receptance = system.receptance(waves * base[:, np.newaxis])
    loop = np.eye(system.axes.size) + gain[..., np.newaxis, np.newaxis] * (mean_force(cut)[both] @ receptance)
    if cut.process_damping:
        rate = 2j * cut.repeats_per_turn * waves * depth[:, np.newaxis]
        loop = loop + rate[..., np.newaxis, np.newaxis] * (mean_damping(cut)[both] @ receptance)
    best = np.argmin(np.abs(np.linalg.det(loop)), axis=1)[:, np.newaxis]
    return np.take_along_axis(waves, best, axis=1)[:, 0]


def _force_harmonics(system: MillingSystem, cut: Cut, number: int) -> Complexes:
    """Return harmonics H_(k-l) of the force matrix of the teeth of each delay, (delays, number, number, p, p)."""
    samples = FORCE_HARMONIC_SAMPLES * len(cut.pitch_pattern)
    forces = interval_forces(cut, samples)[..., system.axes[:, np.newaxis], system.axes]
    harmonics = np.fft.fft(forces, axis=1) / samples
    order = np.arange(number)
    return np.asarray(harmonics[:, order[:, np.newaxis] - order])


def _damping_harmonics(system: MillingSystem, cut: Cut, number: int) -> Complexes:
    """Return harmonics N_(k-l) of C / D n n' of all teeth, shape (number, number, p, p)."""
    cuts = [replace(cut, radial=radial) for radial in (cut.process_damping, 0.0)]
    normal, without = (_force_harmonics(system, each, number).sum(axis=0) for each in cuts)
    return np.asarray(normal - without)


def spectral_radius(
    x: TipModes, y: TipModes, cut: Cut, speed_rpm: ArrayLike, depth: ArrayLike, vectors: ArrayLike | None = None
) -> Floats:
    """Return the largest magnitude of the Floquet multipliers over a tooth period; < 1 is stable.

    Any immersion, any number of modes, straight or helical teeth. The tooth period is divided finely enough
    for all significant modes at the largest depth.

    Parameters
    ----------
    x, y : sequence of Mode, or None
        Modes of each direction of the machine (`Cut.feed_angle` defines the feed); None for a rigid direction.
    cut : Cut
        Cutter, immersion and material.
    speed_rpm : array_like, shape (n_speed,)
        Spindle speeds (rpm).
    depth : array_like, shape (n_depth,)
        Axial depths (m).
    vectors : array_like, shape (n, 2), optional
        Directions of the modes of x, then of y, with rotated principal directions (`build_milling_system`).

    Returns
    -------
    ndarray, shape (n_speed, n_depth)
        Spectral radius (-).

    Raises
    ------
    ValueError
        For invalid speeds, depths, modes or vectors.

    References
    ----------
    Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, with a high order
    (`lobes.floquet.period_map`).

    Examples
    --------
    Below 1 is stable. Without a cut a free mode decays by exp(-zeta w T) in a tooth period T:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> spectral_radius([mode], [mode], slot, 12000.0, [1e-9, 0.2e-3, 2e-3]).round(3).tolist()
    [[0.855, 0.863, 0.959]]
    >>> round(float(np.exp(-0.02 * 2 * np.pi * 500.0 * 60 / (2 * 12000.0))), 3)
    0.855
    """
    system, speed = build_milling_system(x, y, vectors), check_speeds(speed_rpm)
    text = "is not a finite depth >= 0 m (1 mm is 1e-3 m)"
    deep = check_vector("depth", depth, "depth (m)", text, may_be_zero=True)
    rows = rows_at_speeds(system, cut, speed)
    grid = np.broadcast_to(deep, (speed.size, deep.size))
    return spectral_radii(rows, grid, count_pieces(rows, float(np.max(deep))))


def stability_boundary(
    x: TipModes, y: TipModes, cut: Cut, speed_rpm: ArrayLike, max_depth: float, vectors: ArrayLike | None = None
) -> StabilityLobes:
    """Compute the stability boundary over speed by semi-discretization.

    `depth` is the lowest crossing, inf if there is none; `crossings` are all, islands too. `kind` is "flip" for a
    multiplier of -1 (period two), else "hopf"; the chatter frequency is the dominant one of the multiplier. The tooth
    period is divided into pieces for all significant modes, and twice as finely until limits and kinds have converged
    within 0.25 %; `detail` states how many that took.

    Parameters
    ----------
    x, y : sequence of Mode, or None
        Modes of each direction of the machine; None for a rigid direction.
    cut : Cut
        Cutter, immersion and material.
    speed_rpm : array_like, shape (n,)
        Spindle speeds (rpm).
    max_depth : float
        Deepest cut of interest (m).
    vectors : array_like, shape (n, 2), optional
        Directions of the modes of x, then of y, with rotated principal directions (`build_milling_system`).

    Returns
    -------
    StabilityLobes
        Depths (m) up to max_depth where milling changes from stable to unstable or back.

    Raises
    ------
    ValueError
        For invalid speeds, depths, modes or vectors.
    ArithmeticError
        If a limit does not converge.

    References
    ----------
    Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, with a high order
    (`lobes.floquet.period_map`).

    Examples
    --------
    Low immersion has flips between the lobes of a mean force, above 60 f / (N (k + 1/2)), 10000 rpm here:

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=1e6)
    >>> thin = Cut(teeth=2, immersion=0.1, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = stability_boundary([mode], None, thin, [9000.0, 9500.0, 9900.0, 10500.0, 12000.0], max_depth=0.05)
    >>> [f"{depth * 1e3:.2f} mm, {kind}" for depth, kind in zip(lobes.depth, lobes.kind, strict=True)]
    ['1.11 mm, hopf', '1.53 mm, hopf', '2.12 mm, hopf', '0.96 mm, flip', '5.30 mm, flip']
    """
    system, speed = build_milling_system(x, y, vectors), check_speeds(speed_rpm)
    check_number("max_depth", max_depth, "m is not a finite depth > 0. Give the largest depth of cut of interest.")
    rows = rows_at_speeds(system, cut, speed)
    crossings, number = converged_crossings(rows, float(max_depth))
    depth = crossings[:, 0]
    chatter, kind = chatter_at_limits(system, rows, depth, number)
    low, high = int(np.min(number)), int(np.max(number))
    detail = f"{low if low == high else f'{low} to {high}'} time steps of order 16 per tooth period"
    return StabilityLobes(speed, depth, chatter, kind, crossings, "semi-discretisation", detail=detail)


def chatter_at_limits(
    system: MillingSystem, rows: MillingRows, depth: Floats, number: Integers
) -> tuple[Floats, NDArray[np.str_]]:
    """Return chatter frequency (Hz) and kind at limits (r,) in m, with pieces (r,); nan and "" without a limit."""
    chatter, kind = np.full(depth.shape, np.nan), np.full(depth.shape, "", dtype="<U4")
    limited = np.flatnonzero(np.isfinite(depth))
    if limited.size:
        rows, depth = rows[limited], depth[limited]
        multiplier = largest_multipliers(rows, depth[:, np.newaxis], number[limited])[:, 0]
        chatter[limited] = loudest_chatter_frequency(system, rows.cut, multiplier, depth, 1 / rows.period)
        kind[limited] = np.where(is_flip(multiplier), "flip", "hopf")
    return chatter, kind
