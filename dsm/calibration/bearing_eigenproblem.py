"""Every bearing stiffness that puts a mode at a frequency, as one small eigenvalue problem."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.calibration.stiffness_groups import calibrated_parts
from dsm.matrix.assemble import assemble
from dsm.matrix.count_below import number_below
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.matrix.symmetric_factor import symmetric_factor
from dsm.spindle.spindle import Spindle, require_support

_Float = NDArray[np.float64]


BEYOND_LINK = 4
"""Dofs from one side of a joint to the other, with force and moment between them."""


class CalibratedSprings(NamedTuple):
    """The springs that have a common factor, m of them, and the shaft without them."""

    parts: tuple[int, ...]
    """Places in (*bearings, *joints) of what the springs belong to; a joint has two."""
    model: DynamicStiffness
    """The shaft without these springs."""
    forces: _Float
    """Pairs of forces across the springs, times the roots of their stiffness and the model's scale, (n_dofs, m)."""
    housing: _Float
    """Compliance of the housings with the same weights, shape (m, m), diagonal."""


@dataclass(frozen=True, eq=False)
class BearingEigenproblem:
    """Eigenpairs of the compliance at the calibrated springs of bearings and joints, these springs taken away.

    With R = B^T K(w)^-1 B + 1/k_housing, each spring weighted with the root of its stiffness, w is a natural frequency
    where -1/factor is an eigenvalue of R.
    """

    springs: CalibratedSprings
    """The calibrated springs."""
    w2: _Float
    """Square of the angular frequency ((rad/s)^2), shape (n,)."""
    below: NDArray[np.int_]
    """Number of modes of the shaft without these springs below each frequency, shape (n,)."""
    response: _Float
    """K^-1 B with the weights, over the scale of the model: response of all dofs, shape (n, n_dofs, n_springs)."""
    values: _Float
    """Eigenvalues, rising, shape (n, n_springs)."""
    vectors: _Float
    """Eigenvectors in columns, shape (n, n_springs, n_springs)."""

    def pick(self, mode: int) -> NDArray[np.int_]:
        """Index of the eigenvalue that belongs to a mode (1 is the lowest), shape (n,); -1 where there is none.

        Of the eigenvalues in rising order it is number N - mode (0 is the first), N the number of modes of the shaft
        without these springs below w: each factor that passes through such a value moves one mode past w.
        """
        index = self.below - mode
        found = (index >= 0) & (index < self.values.shape[1])
        value = self.values[np.arange(index.size), np.where(found, index, 0)]
        return np.where(found & (value < 0), index, -1)

    def sensitivity(self, index: int) -> float:
        """d ln f / d ln k for an eigenvalue at the first frequency.

        With -1/factor = v^T R v it is d(v^T R v)/d(w^2) = -phi^T (dK/d w^2) phi, phi = K^-1 B v.
        """
        slope = self.springs.model.slope_of(self.w2[:1], self.response[0] @ self.vectors[0, :, index])
        return float(self.values[0, index] / (2 * self.w2[0] * slope[0]))


def bearing_eigenproblem(spindle: Spindle, frequency: _Float, group: str | None = None) -> BearingEigenproblem:
    """The eigenproblem of the parts of a group (see calibrated_parts) at frequencies (Hz, (n,), > 0).

    One factor of K a frequency gives the response and, by its negative pivots, the count of modes. Raises ValueError
    where there is no such part, for a rigid bearing, and for a shaft not held.
    """
    springs = _springs(spindle, 2.0 ** (math.ceil(4 * math.log2(np.max(frequency, initial=1.0))) / 4), group)
    w2 = (2 * np.pi * frequency) ** 2
    factors = [symmetric_factor(matrix) for matrix in springs.model.scaled(w2)]
    below = np.array([number_below(springs.model, factor) for factor in factors], dtype=int)
    solved = [factor.solve(springs.forces) for factor in factors]
    response = np.array(solved).reshape(w2.size, *springs.forces.shape)
    values, vectors = np.linalg.eigh(springs.forces.T @ response + springs.housing)
    return BearingEigenproblem(springs, w2, below, response, values, vectors)


@lru_cache(maxsize=32)
def _springs(spindle: Spindle, top_frequency: float, group: str | None) -> CalibratedSprings:
    """Springs of the same spindle are not looked up twice."""
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
        forces[near, number], forces[near + BEYOND_LINK, number] = -roots, roots
    softness = [bearing.stiffness / bearing.housing_stiffness for bearing in bearings] + [0.0] * (2 * len(joints))
    return CalibratedSprings(tuple(chosen), model, forces * model.scale[:, np.newaxis], np.diag(softness))
