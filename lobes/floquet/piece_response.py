"""What a piece of time does to the modes: without a cut, and with the forces of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.inverses import inverses
from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.stages import gauss_stages

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def ringing(rows: MillingRows, time: Floats) -> Floats:
    """Map of (q, velocity / w) of all modes over a time (r,) in s without force, shape (r, 2n, 2n)."""
    theta, zeta = rows.frequency * time[:, np.newaxis], rows.damping_ratio
    root = np.sqrt(np.where(zeta == 1, 1 - 1e-12, zeta) ** 2 - 1 + 0j)
    fast, slow = np.exp((-zeta - root) * theta), np.exp((-zeta + root) * theta)
    sine = np.real((slow - fast) / (2 * root))
    cosine = np.real(slow + fast) / 2
    return _blocks(cosine + zeta * sine, sine, -sine, cosine - zeta * sine)


def _blocks(qq: Floats, qv: Floats, vq: Floats, vv: Floats) -> Floats:
    """A matrix (r, 2n, 2n) of four diagonals (r, n)."""
    n = qq.shape[1]
    matrix, i = np.zeros((len(qq), 2 * n, 2 * n)), np.arange(n)
    matrix[:, i, i], matrix[:, i, n + i], matrix[:, n + i, i], matrix[:, n + i, n + i] = qq, qv, vq, vv
    return matrix


@dataclass(frozen=True, eq=False)
class PieceResponse:
    """What a piece of some length does to modes, before the cut closes the loop."""

    ends: Floats
    """z at the end from z at the begin, shape (r, 2n, 2n)."""
    shows: Floats
    """Displacements at the nodes from z at the begin, shape (r, p, s, 2n)."""
    gives: Floats
    """Displacements at the nodes from forces there, shape (r, p, p, s, s)."""
    pushes: Floats
    """z at the end from forces at the nodes, shape (r, 2n, p, s)."""

    @classmethod
    def of(cls, rows: MillingRows, time: Floats) -> PieceResponse:
        """For pieces of a length (r,) in s.

        With x = D at the roots of A (`period_map`, `Stages.root`) and t = theta root, all of it is sums of x, t x and
        t^2 x: velocity = D 1 - theta D c, displacement = 1 + theta A velocity, from forces theta/K D A and
        (theta/K) theta A D A.
        """
        stages = gauss_stages()
        theta, twice = rows.frequency * time[:, np.newaxis], 2 * rows.damping_ratio
        t = theta[..., np.newaxis] * stages.root
        x = 1 / (1 + twice[..., np.newaxis] * t + t**2)
        tx, both = t * x, t * x + twice[..., np.newaxis] * x
        begin, ones, weights = stages.share @ stages.node, stages.share.sum(axis=-1), stages.weight @ stages.share
        per_theta, give = theta[..., np.newaxis], theta / rows.stiffness
        place = np.stack((1 - per_theta * _sums(tx, begin), _sums(tx, ones)), axis=-1)
        forced = t * tx
        if np.any(rows.phase):
            of_place, of_velocity = (share[..., np.newaxis] for share in rows.seen)
            velocity = np.stack((-per_theta * _sums(x, begin), _sums(x, ones)), axis=-1)
            place = of_place[..., np.newaxis] * place + of_velocity[..., np.newaxis] * velocity
            forced = of_place * forced + of_velocity * tx
        pushes = (give[..., np.newaxis] * _sums(of, weights) for of in (tx, x))
        at_begin, at_ones = begin @ stages.weight, ones @ stages.weight
        return cls(
            ends=_blocks(
                1 - theta**2 * _sums(x, at_begin),
                theta * _sums(x, at_ones),
                theta**2 * _sums(both, at_begin) - theta,
                1 - theta * _sums(both, at_ones),
            ),
            shows=_by_direction(rows, place),
            gives=_sums(
                np.einsum("rnk,rnp,rnq->rpqk", forced / rows.stiffness[..., np.newaxis], rows.vector, rows.vector),
                stages.share,
            ),
            pushes=np.concatenate([np.einsum("rns,rnp->rnps", push, rows.vector) for push in pushes], axis=1),
        )

    def rounded(self, kind: type[np.floating[Any]]) -> PieceResponse:
        """The same in numbers of some precision."""
        return PieceResponse(*(values.astype(kind) for values in (self.ends, self.shows, self.gives, self.pushes)))

    def cutting(self, force: Floats) -> Floats:
        """The maps (k, r, d, m, m) of k pieces with forces -force (d - w) at their nodes, force (p, p, s, k, r, d).

        From z and w at the begin to z at the end and d.
        """
        inverse, push = self._closed(force)
        maps, i = self._maps(inverse, push, -inverse), np.arange(push.shape[-2], sum(push.shape[-2:]))
        maps[..., i, i] += 1
        return maps

    def loaded(self, force: Floats) -> Floats:
        """The maps (k, r, d, m, m) of k pieces with forces f - force d at their nodes, force (p, p, s, k, r, d).

        From z at the begin and f to z at the end and d.
        """
        inverse, push = self._closed(force)
        states, size = push.shape[-2:]
        maps = self._maps(inverse, push, inverse @ self._given()[:, np.newaxis])
        maps[..., :states, states:] += self.pushes.reshape(-1, 1, states, size)
        return maps

    def _maps(self, inverse: Floats, push: Floats, answer: Floats) -> Floats:
        """Maps from z and what is given at the nodes, which is answered by d; that of z pushes back at its end."""
        states, size = push.shape[-2:]
        maps = np.empty((*inverse.shape[:3], states + size, states + size), inverse.dtype)
        np.matmul(inverse, self.shows.reshape(-1, 1, size, states), out=maps[..., states:, :states])
        maps[..., states:, states:] = answer
        np.matmul(push, maps[..., states:, :], out=maps[..., :states, :])
        np.negative(maps[..., :states, :], out=maps[..., :states, :])
        maps[..., :states, :states] += self.ends[:, np.newaxis]
        return maps

    def _closed(self, force: Floats) -> tuple[Floats, Floats]:
        """Displacements of the closed loop from the open one's (k, r, d, ps, ps), z from them (k, r, d, 2n, ps)."""
        p, _, s, *cases = force.shape
        size, states, depths = p * s, self.ends.shape[-1], cases[-1]
        forces = force.reshape(p, p, s, cases[0], -1)
        loop = np.zeros((p, s, p, *forces.shape[2:]), force.dtype)
        push = np.zeros((states, p, *forces.shape[2:]), force.dtype)
        for shown, pushed in zip(*np.nonzero(np.any(self.gives, axis=(0, 3, 4))), strict=True):
            gives = np.repeat(np.moveaxis(self.gives[:, shown, pushed], 0, -1), depths, axis=-1)
            loop[shown] += gives[:, np.newaxis, :, np.newaxis] * forces[pushed]
        loop = loop.reshape(size, size, *forces.shape[3:])
        loop[np.arange(size), np.arange(size)] += 1
        for direction in range(p):
            pushes = np.repeat(np.moveaxis(self.pushes[:, :, direction], 0, -1), depths, axis=-1)
            push += pushes[:, np.newaxis, :, np.newaxis] * forces[direction]
        return _first(inverses(loop), cases), _first(push.reshape(states, size, *forces.shape[3:]), cases)

    def _given(self) -> Floats:
        """Displacements at the nodes from forces there in all directions, shape (r, ps, ps)."""
        r, p, _, s, _ = self.gives.shape
        return np.moveaxis(self.gives, 2, 3).reshape(r, p * s, p * s)


def _first(matrices: Floats, cases: Sequence[int]) -> Floats:
    """Matrices (m, n, ...) of some cases as (cases, m, n)."""
    flat = matrices.reshape(*matrices.shape[:2], -1)
    return np.ascontiguousarray(np.moveaxis(flat, -1, 0)).reshape(*cases, *matrices.shape[:2])


def _sums(values: Complexes, shares: Complexes) -> Floats:
    """Twice the real parts of the sums of values (..., k) at the roots times shares (k, ...)."""
    parts = np.concatenate((values.real, values.imag), axis=-1)
    weights = 2 * np.concatenate((shares.real, -shares.imag))
    flat = parts.reshape(-1, parts.shape[-1]) @ weights.reshape(len(weights), -1)
    return np.asarray(flat.reshape(*values.shape[:-1], *shares.shape[1:]))


def _by_direction(rows: MillingRows, place: Floats) -> Floats:
    """Displacements from z: places (r, n, s, 2) of the modes, each along its vector, shape (r, p, s, 2n)."""
    shown = np.einsum("rnsk,rnp->rpskn", place, rows.vector)
    return np.asarray(shown.reshape(*shown.shape[:3], -1))
