"""Calibrate bearing stiffness to one measured natural frequency."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Floats, Indices, require_number
from dsm.calibration.calibration import Calibration, UnreachableFrequencyError
from dsm.calibration.stiffness_groups import calibrated_parts, parts_stiffness, scale_parts
from dsm.matrix.assemble import assemble
from dsm.matrix.dynamic_stiffness import DynamicStiffness, check_frequencies
from dsm.modes.find_modes import MAX_MODES
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.spindle import Spindle, require_support

DOFS_ACROSS_JOINT = 4
"""Dofs from one side of a joint to the other, with force and moment between them."""


class CalibratedSprings(NamedTuple):
    """Springs with a common factor, m of them, and the shaft without them."""

    parts: tuple[int, ...]
    """Indices in (*bearings, *joints) of the parts of the springs; a joint has two."""
    model: DynamicStiffness
    """Shaft without these springs."""
    forces: Floats
    """Pairs of forces across the springs, times the roots of their stiffness and the model scale, (n_dofs, m)."""
    housing: Floats
    """Compliance of the housings with the same weights, shape (m, m), diagonal."""


class BearingEigenproblem(NamedTuple):
    """Eigenproblem of the compliance at the calibrated springs, on the shaft without them.

    With R = B^T K(w)^-1 B + 1/k_housing, each spring weighted with the root of its stiffness, w is a natural frequency
    if -1/factor is an eigenvalue of R.
    """

    springs: CalibratedSprings
    """The calibrated springs."""
    w2: Floats
    """Squared angular frequencies ((rad/s)^2), shape (n,)."""
    below: Indices
    """Number of modes of the shaft without these springs below each frequency, shape (n,)."""
    response: Floats
    """Response K^-1 B of all dofs with the weights, over the scale of the model, shape (n, n_dofs, n_springs)."""
    values: Floats
    """Eigenvalues, rising, shape (n, n_springs)."""
    vectors: Floats
    """Eigenvectors in columns, shape (n, n_springs, n_springs)."""

    def pick(self, mode: int) -> Indices:
        """Return the index of the eigenvalue of a mode (1 is the lowest), shape (n,); -1 if there is none.

        In rising order it is number N - mode (0 is the first), N the number of modes of the shaft
        without these springs below w: each factor that passes through such a value moves one mode past w.
        """
        index = self.below - mode
        found = (index >= 0) & (index < self.values.shape[1])
        value = self.values[np.arange(index.size), np.where(found, index, 0)]
        return np.where(found & (value < 0), index, -1)

    def sensitivity(self, index: int) -> float:
        """Return d ln f / d ln k for an eigenvalue at the first frequency.

        With -1/factor = v^T R v it is d(v^T R v)/d(w^2) = -phi^T (dK/d w^2) phi, phi = K^-1 B v.
        """
        slope = self.springs.model.slope_of(self.w2[:1], self.response[0] @ self.vectors[0, :, index])
        return float(self.values[0, index] / (2 * self.w2[0] * slope[0]))


def bearing_eigenproblem(spindle: Spindle, frequency: Floats, group: str | None = None) -> BearingEigenproblem:
    """Build the eigenproblem of the parts of a group (see calibrated_parts) at frequencies (Hz, (n,), > 0).

    One factor of K per frequency gives the response and, by its negative pivots, the count of modes. Raises ValueError
    if there is no such part, for a rigid bearing, and for an unsupported shaft.
    """
    springs = _calibrated_springs(spindle, 2.0 ** (math.ceil(4 * math.log2(np.max(frequency, initial=1.0))) / 4), group)
    w2 = (2 * np.pi * frequency) ** 2
    factors = springs.model.factors(w2)
    below = np.array([factor.modes_below for factor in factors], dtype=int)
    solved = [factor.solve(springs.forces) for factor in factors]
    response = np.array(solved).reshape(w2.size, *springs.forces.shape)
    values, vectors = np.linalg.eigh(springs.forces.T @ response + springs.housing)
    return BearingEigenproblem(springs, w2, below, response, values, vectors)


@lru_cache(maxsize=32)
def _calibrated_springs(spindle: Spindle, top_frequency: float, group: str | None) -> CalibratedSprings:
    require_support(spindle)
    chosen = calibrated_parts(spindle, group)
    model = assemble(spindle, top_frequency, left_out=chosen)
    count = len(spindle.bearings)
    bearings = [spindle.bearings[index] for index in chosen if index < count]
    joints = [spindle.joints[index - count] for index in chosen if index >= count]
    forces = np.zeros((model.scale.size, len(bearings) + 2 * len(joints)))
    number = np.arange(len(bearings))
    forces[model.dofs(bearings), number] = np.sqrt([bearing.stiffness for bearing in bearings])
    for dof, name in enumerate(("stiffness", "rotational_stiffness")):
        number = len(bearings) + dof + 2 * np.arange(len(joints))
        roots, near = np.sqrt([getattr(joint, name) for joint in joints]), model.dofs(joints) + dof
        forces[near, number], forces[near + DOFS_ACROSS_JOINT, number] = -roots, roots
    softness = [bearing.stiffness / bearing.housing_stiffness for bearing in bearings] + [0.0] * (2 * len(joints))
    return CalibratedSprings(tuple(chosen), model, forces * model.scale[:, np.newaxis], np.diag(softness))


def stiffness_curve(spindle: Spindle, frequency: ArrayLike, mode: int = 1, group: str | None = None) -> Floats:
    """Compute the bearing stiffness for which a mode has each frequency.

    The stiffnesses keep their given ratios. Figure 8 of Gaber & Hashemi, Shock and Vibration, 2015, is such a curve.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    frequency : array_like, shape (n,)
        Frequencies (Hz), > 0.
    mode : int
        Number of the mode; 1 is the lowest.
    group : str, optional
        Group of bearings and joints. Default: all bearings with a group.

    Returns
    -------
    ndarray, shape (n,)
        Mean stiffness of the group (N/m); NaN if no stiffness gives the frequency.

    Raises
    ------
    ValueError
        For frequencies that are not > 0, and as calibrate for the bearings.

    Examples
    --------
    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> f = natural_frequencies(spindle, 1)[0]
    >>> (stiffness_curve(spindle, [f, 0.9 * f, 3 * f]) / 1e6).round(1).tolist()  # N/um; no bearing gives the last one
    [250.0, 196.9, nan]
    """
    mean = parts_stiffness(spindle, calibrated_parts(spindle, group))
    problem = bearing_eigenproblem(spindle, check_frequencies(frequency, positive=True), group)
    index = problem.pick(mode)
    value = problem.values[np.arange(index.size), np.where(index < 0, 0, index)]
    return mean * np.where(index < 0, np.nan, -1 / value)


LOOSE_JOINT_FACTOR = 1e-9
"""Factor on the stiffness of a joint that counts as absent."""
STANDARD_ERRORS_95_PERCENT = 1.96
"""Half-width of a 95 % interval (standard errors)."""


def calibrate(
    spindle: Spindle, frequency: float, frequency_std: float | None = None, mode: int = 1, group: str | None = None
) -> Calibration:
    """Scale bearing stiffnesses by one factor, so that a mode has its measured frequency.

    The given stiffnesses define only the ratio of the bearings. The factor is exact, from
    an eigenvalue problem of the order of the number of bearings; a count of modes selects the eigenvalue. Its
    standard error follows from that of the frequency by the chain rule. Near the limit of rigid
    bearings the frequency is linear in 1/k, not in k: the 95 % interval of the stiffness is that of the frequency,
    end by end. Stiffness of bearings against tilting and of the housing is unchanged.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    frequency : float
        Measured frequency (Hz).
    frequency_std : float, optional
        Standard error of the frequency (Hz).
    mode : int
        Number of the mode; 1 is the lowest.
    group : str, optional
        Group of bearings and joints. Default: all bearings with a group, and no joint, whose wear one
        frequency cannot separate from theirs (fit_stiffness with several can, and takes all groups).

    Returns
    -------
    Calibration
        Recalibrated spindle with stiffness and error.

    Raises
    ------
    UnreachableFrequencyError
        If the frequency is outside the range of the springs.
    ValueError
        For a frequency not > 0, an unsupported shaft, and a group with no bearing or a rigid one.

    Examples
    --------
    Bearings with 250 N/um when new, and the frequency of a spindle that has run for some years:

    >>> new = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> measured = 0.95 * natural_frequencies(new, 1)[0]
    >>> now = calibrate(new, measured, frequency_std=2.0)
    >>> format_with_error(now.bearing_stiffness, now.bearing_stiffness_std, 1e6, "N/um"), round(now.factor, 3)
    ('222.2 ± 1.0 N/um', 0.889)
    >>> abs(now.residual) < 1e-6  # Hz: solved again
    True
    """
    require_number("frequency", frequency, " Hz", positive=True)
    require_number("frequency_std", frequency_std, " Hz")
    if not 1 <= mode <= MAX_MODES:
        raise ValueError(f"mode={mode} is not between 1 (the lowest) and {MAX_MODES}")
    frequencies = [frequency]
    if frequency_std is not None:
        half = STANDARD_ERRORS_95_PERCENT * frequency_std
        frequencies += [max(frequency - half, LOOSE_JOINT_FACTOR * frequency), frequency + half]
    problem = bearing_eigenproblem(spindle, np.array(frequencies), group)
    index, *ends = problem.pick(mode).tolist()
    chosen = problem.springs.parts
    if index < 0:
        raise _unreachable_error(spindle, frequency, mode, chosen)
    factor, sensitivity = float(-1 / problem.values[0, index]), problem.sensitivity(index)
    stiffness, std, interval = factor * parts_stiffness(spindle, chosen), None, None
    if frequency_std is not None:
        std = stiffness * frequency_std / frequency / sensitivity
        start, (low, high) = stiffness / factor, ends
        interval = (
            0.0 if low < 0 else float(-start / problem.values[1, low]),
            math.inf if high < 0 else float(-start / problem.values[2, high]),
        )
    return Calibration(
        frequency=float(frequency),
        frequency_std=frequency_std,
        mode=mode,
        bearing_stiffness=stiffness,
        bearing_stiffness_std=std,
        bearing_stiffness_interval=interval,
        factor=factor,
        sensitivity=sensitivity,
        given=spindle,
        parts=chosen,
    )


def _unreachable_error(spindle: Spindle, f: float, mode: int, chosen: Sequence[int]) -> UnreachableFrequencyError:
    low, high = (float(natural_frequencies(limit, mode)[-1]) for limit in _limit_spindles(spindle, chosen))
    return UnreachableFrequencyError(
        f"no bearing stiffness gives mode {mode} at {f:g} Hz, only {low:.1f} Hz (no bearings) to {high:.1f} Hz (rigid "
        "bearings). Check the geometry of the model and the mode number.",
        (low, high),
    )


def _limit_spindles(spindle: Spindle, chosen: Sequence[int]) -> tuple[Spindle, Spindle]:
    """Return the spindle without the calibrated parts and with rigid ones; joints nearly absent and absent."""
    count = len(spindle.bearings)
    soft = [bearing for index, bearing in enumerate(spindle.bearings) if index not in chosen]
    hard = [replace(b, stiffness=math.inf) if i in chosen else b for i, b in enumerate(spindle.bearings)]
    loose = scale_parts(spindle, [index for index in chosen if index >= count], LOOSE_JOINT_FACTOR).joints
    fast = [joint for index, joint in enumerate(spindle.joints, count) if index not in chosen]
    return replace(spindle, bearings=soft, joints=loose), replace(spindle, bearings=hard, joints=fast)
