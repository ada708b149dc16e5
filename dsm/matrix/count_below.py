"""Number of natural frequencies below a frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.matrix.symmetric_factor import SymmetricFactor, symmetric_factor


def count_below(model: DynamicStiffness, eigenvalue: NDArray[np.float64]) -> NDArray[np.int_]:
    """Number of natural frequencies below w, shape (n,), for w^2 (w where it spins): the negative pivots of K(w).

    None is missed and double ones count twice. Source: W. H. Wittrick and F. W. Williams, A general algorithm for
    computing natural frequencies of elastic structures, Q. J. Mech. Appl. Math. 24 (1971), with J0 = 0. The pivoting
    of Bunch and Kaufman and rows scaled to one another keep it right where a part of the shaft is at resonance; those
    of links are taken off. Where the shaft spins, the modes of forward whirl are counted for w > 0: phi^T K(w) phi
    falls through 0 once, for any phi.
    """
    counts = [number_below(model, symmetric_factor(matrix)) for matrix in model.scaled(eigenvalue)]
    return np.array(counts, dtype=int)


def number_below(model: DynamicStiffness, factor: SymmetricFactor) -> int:
    """The same from the factor of K(w): its negative pivots but for the two of each link that carries force."""
    return factor.negative - model.link_pivots
