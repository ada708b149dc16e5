"""Every bearing stiffness that puts a mode at a frequency, as one small eigenvalue problem."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.assemble import assemble
from dsm.matrix.count_below import count_below
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.spindle import Spindle, require_support

_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BearingEigenproblem:
    """Eigenpairs of the compliance at the calibrated bearings, their own springs taken away.

    With R = B^T K(w)^-1 B + 1/k_housing, each bearing weighted with the root of its stiffness, w is a natural frequency
    where -1/factor is an eigenvalue of R.
    """

    model: DynamicStiffness
    """The shaft without the springs of the calibrated bearings."""
    w2: _Float
    """Square of the angular frequency ((rad/s)^2), shape (n,)."""
    response: _Float
    """K^-1 B with the weights: response of all dofs to the bearing forces, shape (n, n_dofs, n_bearings)."""
    values: _Float
    """Eigenvalues, rising, shape (n, n_bearings)."""
    vectors: _Float
    """Eigenvectors in columns, shape (n, n_bearings, n_bearings)."""

    def pick(self, mode: int) -> NDArray[np.int_]:
        """Index of the eigenvalue that belongs to a mode (1 is the lowest), shape (n,); -1 where there is none.

        Of the eigenvalues in rising order it is number N - mode (0 is the first), N the number of modes of the shaft
        without these springs below w: each factor that passes through such a value moves one mode past w.
        """
        index = count_below(self.model, self.w2) - mode
        found = (index >= 0) & (index < self.values.shape[1])
        value = self.values[np.arange(index.size), np.where(found, index, 0)]
        return np.where(found & (value < 0), index, -1)


def bearing_eigenproblem(spindle: Spindle, frequency: _Float, group: str | None = None) -> BearingEigenproblem:
    """The eigenproblem of the bearings of a group (None: of all but those of no group) at frequencies (Hz, (n,), > 0).

    Raises ValueError where there is no such bearing, for a rigid one, and for a shaft not held.
    """
    require_support(spindle)
    chosen = calibrated_bearings(spindle, group)
    bearings = [spindle.bearings[index] for index in chosen]
    top = 2.0 ** (math.ceil(4 * math.log2(np.max(frequency, initial=1.0))) / 4)
    model = assemble(spindle, top, left_out=chosen)
    w2 = (2 * np.pi * frequency) ** 2
    dofs = [2 * model.node(bearing.position) for bearing in bearings]
    root = np.sqrt([bearing.stiffness for bearing in bearings])
    forces = np.zeros((model.held.size, root.size))
    forces[dofs, np.arange(root.size)] = root
    response = model.solve(model.dense(w2), forces)
    housing = np.diag([bearing.stiffness / bearing.housing_stiffness for bearing in bearings])
    compliance = root[:, np.newaxis] * response[:, dofs] + housing
    values, vectors = np.linalg.eigh((compliance + compliance.swapaxes(1, 2)) / 2)
    return BearingEigenproblem(model, w2, response, values, vectors)


def calibrated_bearings(spindle: Spindle, group: str | None = None) -> list[int]:
    """Indices (0 is the first) of the bearings of a group; None: of all but those of no group."""
    chosen = [
        index
        for index, bearing in enumerate(spindle.bearings)
        if (bearing.group if group is None else bearing.group == group)
    ]
    if not chosen:
        known = ", ".join(sorted({repr(bearing.group) for bearing in spindle.bearings if bearing.group})) or "none"
        wanted = "with a group" if group is None else f"of group {group!r}"
        raise ValueError(f"there is no bearing {wanted} to calibrate; groups of this spindle: {known}")
    for index in chosen:
        if math.isinf(spindle.bearings[index].stiffness):
            raise ValueError(
                f"bearing {index + 1}: stiffness=inf cannot be calibrated; give a finite one to start from, "
                "or the group '' to leave it rigid"
            )
    return chosen
