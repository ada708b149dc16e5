"""Response of the modes over one piece of time, with and without a cut."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray

from lobes.floquet.milling_rows import MillingRows
from modal.arrays import Complexes, Floats

NODES_PER_PIECE = 8
"""Nodes of one piece: a polynomial of degree 7 for the displacement, of order 16 at the end of the piece."""


Precision = type[np.floating[Any]]
"""Type of the numbers of a map: float32 or float64."""


class GaussNodes(NamedTuple):
    """Gauss-Legendre nodes and integrals for s nodes in a piece of length 1."""

    node: Floats
    """Positions of the nodes, shape (s,)."""
    weight: Floats
    """Integral over the whole piece, shape (s,)."""
    integral: Floats
    """Integrals from the begin to each node, shape (s, s)."""
    root: Complexes
    """Eigenvalues of the integrals, those above the real axis of each pair, shape (s/2,)."""
    share: Complexes
    """Weights of the roots: f(integral) is twice the real part of the sum of f(root) times these, shape (s/2, s, s)."""


def interpolation_weights(place: Floats) -> Floats:
    """Return the weights of the node values in the polynomial at places (...) in 0 to 1, shape (..., s)."""
    node = gauss_nodes().node
    apart = place[..., np.newaxis, np.newaxis] - node
    own = np.eye(node.size, dtype=bool)
    above, below = (np.prod(np.where(own, 1.0, part), axis=-1) for part in (apart, node[:, np.newaxis] - node))
    return np.asarray(above / below)


@cache
def gauss_nodes(count: int = NODES_PER_PIECE) -> GaussNodes:
    """Return nodes and integrals of the polynomial through them, for an even number of nodes.

    Source: Hairer & Wanner, Solving Ordinary Differential Equations II, Springer 1996, ch. IV.5.
    """
    x, weight = leggauss(count)
    high = legvander(x, count)
    order = np.arange(1, count)
    integral = np.column_stack((x + 1, (high[:, 2:] - high[:, :-2]) / (2 * order + 1)))
    integral = integral @ np.linalg.inv(high[:, :-1]) / 2
    root, vectors = np.linalg.eig(integral)
    share = vectors.T[:, :, np.newaxis] * np.linalg.inv(vectors)[:, np.newaxis]
    return GaussNodes((x + 1) / 2, weight / 2, integral, root[root.imag > 0], share[root.imag > 0])


def invert_matrices(matrices: NDArray[np.floating[Any]]) -> Floats:
    """Invert matrices (m, m, ...) whose leading parts are far from singular, without exchange of rows.

    The loop matrix of a piece is such a matrix: 1 plus what is integrated since the piece began. By Gauss-Jordan
    elimination of all of them together. A singular one gives numbers that are not finite.
    Source: Golub & Van Loan, Matrix Computations, 4th ed., ch. 3.2 and 3.4.
    """
    left = np.array(matrices)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for i in range(len(left)):
            pivot = 1 / left[i, i]
            column = left[:, i].copy()
            column[i] = 0
            left[:, i] = 0
            left[i, i] = 1
            left[i] *= pivot
            left -= column[:, np.newaxis] * left[i]
    return left


def free_response(rows: MillingRows, time: Floats) -> Floats:
    """Return the map of (q, velocity / w) of all modes over a time (r,) in s without force, shape (r, 2n, 2n)."""
    theta, zeta = rows.frequency * time[:, np.newaxis], rows.damping_ratio
    root = np.sqrt(np.where(zeta == 1, 1 - 1e-12, zeta) ** 2 - 1 + 0j)
    fast, slow = np.exp((-zeta - root) * theta), np.exp((-zeta + root) * theta)
    sine = np.real((slow - fast) / (2 * root))
    cosine = np.real(slow + fast) / 2
    return _block_matrix(cosine + zeta * sine, sine, -sine, cosine - zeta * sine)


def _block_matrix(qq: Floats, qv: Floats, vq: Floats, vv: Floats) -> Floats:
    """Return a matrix (r, 2n, 2n) of four diagonals (r, n)."""
    n = qq.shape[1]
    matrix, i = np.zeros((len(qq), 2 * n, 2 * n)), np.arange(n)
    matrix[:, i, i], matrix[:, i, n + i], matrix[:, n + i, i], matrix[:, n + i, n + i] = qq, qv, vq, vv
    return matrix


@dataclass(frozen=True, eq=False)
class PieceResponse:
    """Response of the modes over a piece, before the cut closes the loop."""

    end_state: Floats
    """z at the end from z at the begin, shape (r, 2n, 2n)."""
    node_displacement: Floats
    """Displacements at the nodes from z at the begin, shape (r, p, s, 2n)."""
    node_flexibility: Floats
    """Displacements at the nodes from forces there, shape (r, p, p, s, s)."""
    end_state_per_force: Floats
    """z at the end from forces at the nodes, shape (r, 2n, p, s)."""

    @classmethod
    def of(cls, rows: MillingRows, time: Floats) -> Self:
        """Compute the response over pieces of a length (r,) in s.

        With x = D at the roots of A (`lobes.floquet.period_map`, `GaussNodes.root`) and t = theta root, all of it is
        sums of x, t x and t^2 x: velocity = D 1 - theta D c, displacement = 1 + theta A velocity, from forces theta/K D
        A and
        (theta/K) theta A D A.
        """
        nodes = gauss_nodes()
        theta, twice = rows.frequency * time[:, np.newaxis], 2 * rows.damping_ratio
        t = theta[..., np.newaxis] * nodes.root
        x = 1 / (1 + twice[..., np.newaxis] * t + t**2)
        tx, both = t * x, t * x + twice[..., np.newaxis] * x
        begin, ones, weights = nodes.share @ nodes.node, nodes.share.sum(axis=-1), nodes.weight @ nodes.share
        per_theta, give = theta[..., np.newaxis], theta / rows.stiffness
        place = np.stack((1 - per_theta * weighted_sums(tx, begin), weighted_sums(tx, ones)), axis=-1)
        forced = t * tx
        if np.any(rows.phase):
            of_place, of_velocity = (share[..., np.newaxis] for share in rows.tip_participation)
            velocity = np.stack((-per_theta * weighted_sums(x, begin), weighted_sums(x, ones)), axis=-1)
            place = of_place[..., np.newaxis] * place + of_velocity[..., np.newaxis] * velocity
            forced = of_place * forced + of_velocity * tx
        pushes = (give[..., np.newaxis] * weighted_sums(of, weights) for of in (tx, x))
        at_begin, at_ones = begin @ nodes.weight, ones @ nodes.weight
        end_state = _block_matrix(
            1 - theta**2 * weighted_sums(x, at_begin),
            theta * weighted_sums(x, at_ones),
            theta**2 * weighted_sums(both, at_begin) - theta,
            1 - theta * weighted_sums(both, at_ones),
        )
        flexible = forced / rows.stiffness[..., np.newaxis]
        flexible = np.einsum("rnk,rnp,rnq->rpqk", flexible, rows.vector, rows.vector)
        per_force = np.concatenate([np.einsum("rns,rnp->rnps", push, rows.vector) for push in pushes], axis=1)
        shown = np.einsum("rnsk,rnp->rpskn", place, rows.vector)
        at_nodes = shown.reshape(*shown.shape[:3], -1)
        return cls(end_state, at_nodes, weighted_sums(flexible, nodes.share), per_force)

    def as_precision(self, kind: Precision) -> Self:
        """Return the response with numbers of another precision."""
        return replace(self, **{name: values.astype(kind) for name, values in vars(self).items()})

    def cutting(self, force: Floats) -> Floats:
        """Return the maps (k, r, d, m, m) of k pieces with forces -force (d - w) at their nodes.

        force (p, p, s, k, r, d). From z and w at the begin to z at the end and d.
        """
        inverse, push = self._closed(force)
        maps, i = self._maps(inverse, push, -inverse), np.arange(push.shape[-2], sum(push.shape[-2:]))
        maps[..., i, i] += 1
        return maps

    def loaded(self, force: Floats) -> Floats:
        """Return the maps (k, r, d, m, m) of k pieces with forces f - force d at their nodes.

        force (p, p, s, k, r, d). From z at the begin and f to z at the end and d.
        """
        inverse, push = self._closed(force)
        states, size = push.shape[-2:]
        given = np.moveaxis(self.node_flexibility, 2, 3).reshape(-1, 1, size, size)
        maps = self._maps(inverse, push, inverse @ given)
        maps[..., :states, states:] += self.end_state_per_force.reshape(-1, 1, states, size)
        return maps

    def _maps(self, inverse: Floats, push: Floats, answer: Floats) -> Floats:
        """Return maps from z and the given node values, whose response is d, to z at the end and d."""
        states, size = push.shape[-2:]
        maps = np.empty((*inverse.shape[:3], states + size, states + size), inverse.dtype)
        np.matmul(inverse, self.node_displacement.reshape(-1, 1, size, states), out=maps[..., states:, :states])
        maps[..., states:, states:] = answer
        np.matmul(push, maps[..., states:, :], out=maps[..., :states, :])
        np.negative(maps[..., :states, :], out=maps[..., :states, :])
        maps[..., :states, :states] += self.end_state[:, np.newaxis]
        return maps

    def _closed(self, force: Floats) -> tuple[Floats, Floats]:
        """Return closed-loop over open-loop displacements (k, r, d, ps, ps), and z from them (k, r, d, 2n, ps)."""
        p, _, s, *cases = force.shape
        size, states, depths = p * s, self.end_state.shape[-1], cases[-1]
        forces = force.reshape(p, p, s, cases[0], -1)
        loop = np.zeros((p, s, p, *forces.shape[2:]), force.dtype)
        push = np.zeros((states, p, *forces.shape[2:]), force.dtype)
        for shown, pushed in zip(*np.nonzero(np.any(self.node_flexibility, axis=(0, 3, 4))), strict=True):
            gives = np.repeat(np.moveaxis(self.node_flexibility[:, shown, pushed], 0, -1), depths, axis=-1)
            loop[shown] += gives[:, np.newaxis, :, np.newaxis] * forces[pushed]
        loop = loop.reshape(size, size, *forces.shape[3:])
        loop[np.arange(size), np.arange(size)] += 1
        for direction in range(p):
            pushes = np.repeat(np.moveaxis(self.end_state_per_force[:, :, direction], 0, -1), depths, axis=-1)
            push += pushes[:, np.newaxis, :, np.newaxis] * forces[direction]
        push = push.reshape(states, size, *forces.shape[3:])
        return _cases_first(invert_matrices(loop), cases), _cases_first(push, cases)


def _cases_first(matrices: Floats, cases: Sequence[int]) -> Floats:
    """Reorder matrices (m, n, ...) of some cases to (cases, m, n)."""
    flat = matrices.reshape(*matrices.shape[:2], -1)
    return np.ascontiguousarray(np.moveaxis(flat, -1, 0)).reshape(*cases, *matrices.shape[:2])


def weighted_sums(values: Complexes, shares: Complexes) -> Floats:
    """Return twice the real parts of the sums of values (..., k) at the roots times shares (k, ...)."""
    parts = np.concatenate((values.real, values.imag), axis=-1)
    weights = 2 * np.concatenate((shares.real, -shares.imag))
    flat = parts.reshape(-1, parts.shape[-1]) @ weights.reshape(len(weights), -1)
    return np.asarray(flat.reshape(*values.shape[:-1], *shares.shape[1:]))
