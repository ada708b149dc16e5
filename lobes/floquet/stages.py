"""The Gauss-Legendre nodes of one piece of time, and how what happens there is summed up."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray

STAGES = 8
"""Nodes of one piece: a polynomial of degree 7 through the displacement, of order 16 at the end of the piece."""


class Stages(NamedTuple):
    """For s nodes in a piece of length 1."""

    node: NDArray[np.float64]
    """Places of the nodes, shape (s,)."""
    weight: NDArray[np.float64]
    """Integral over the whole piece, shape (s,)."""
    integral: NDArray[np.float64]
    """Integrals from the begin to each node, shape (s, s)."""
    root: NDArray[np.complex128]
    """Eigenvalues of the integrals, those above the real axis of each pair, shape (s/2,)."""
    share: NDArray[np.complex128]
    """What each adds: f(integral) is twice the real part of the sum of f(root) times these, shape (s/2, s, s)."""


def polynomial_at(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of the values at the nodes in the polynomial through them at places (...) in 0 to 1, shape (..., s)."""
    node = gauss_stages().node
    apart = place[..., np.newaxis, np.newaxis] - node
    own = np.eye(node.size, dtype=bool)
    return np.asarray(
        np.prod(np.where(own, 1.0, apart), axis=-1) / np.prod(np.where(own, 1.0, node[:, np.newaxis] - node), axis=-1)
    )


@cache
def gauss_stages(count: int = STAGES) -> Stages:
    """Nodes and integrals of the polynomial through them, of an even number of nodes.

    Source: Hairer & Wanner, Solving Ordinary Differential Equations II, Springer 1996, ch. IV.5.
    """
    x, weight = leggauss(count)
    high = legvander(x, count)
    order = np.arange(1, count)
    integral = np.column_stack((x + 1, (high[:, 2:] - high[:, :-2]) / (2 * order + 1)))
    integral = integral @ np.linalg.inv(high[:, :-1]) / 2
    root, vectors = np.linalg.eig(integral)
    share = vectors.T[:, :, np.newaxis] * np.linalg.inv(vectors)[:, np.newaxis]
    return Stages((x + 1) / 2, weight / 2, integral, root[root.imag > 0], share[root.imag > 0])
