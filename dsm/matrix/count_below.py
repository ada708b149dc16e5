"""Number of natural frequencies below a frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dsytrf

from dsm.matrix.dynamic_stiffness import DynamicStiffness


def count_below(model: DynamicStiffness, x: NDArray[np.float64]) -> NDArray[np.int_]:
    """Number of natural frequencies below w, shape (n,), for x = w^2 (w where it spins): the negative pivots of K(w).

    None is missed and double ones count twice. Source: W. H. Wittrick and F. W. Williams, A general algorithm for
    computing natural frequencies of elastic structures, Q. J. Mech. Appl. Math. 24 (1971), with J0 = 0. The pivoting
    of Bunch and Kaufman and rows scaled to one another keep it right where a part of the shaft is at resonance; those
    of links are taken off. Where the shaft spins, the modes of forward whirl are counted for w > 0: phi^T K(w) phi
    falls through 0 once, for any phi.
    """
    matrices = model.dense(x) * np.outer(model.scale, model.scale)
    of_links = 2 * int(np.sum(model.is_link))
    return np.array([_negative_pivots(matrix) - of_links for matrix in matrices], dtype=int)


def _negative_pivots(matrix: NDArray[np.float64]) -> int:
    factor, pivots, _ = dsytrf(matrix, lower=1)
    single = pivots > 0
    return int(np.sum(np.diagonal(factor)[single] < 0) + np.sum(~single) // 2)
