"""The map of milling over one tooth period, piece by piece.

The state is z, for each mode its coordinate q and its velocity over its frequency, and the displacements w of the tool
tip one period ago at the Gauss nodes of each piece in which teeth cut. Within a piece q is a polynomial through its
nodes: w is known there, since the pieces of every period are the same, so nothing is interpolated. Without teeth in
the cut the modes ring freely, exactly. For r rows and d depths:

    z (r, d, 2n), w (r, d, nodes p), p directions      theta = w_n times the length of a piece
    D = (1 + 2 zeta theta A + theta^2 A^2)^-1          A integrates from the begin of the piece to its nodes
    velocity = D (p_0 - theta c q_0 + theta/K A force),  q = q_0 + theta A velocity
    displacement = q, of a complex mode its shares of q and velocity (`MillingRows.seen`)

Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, ch. 3, with polynomials of degree
7 instead of 1 for the delayed term; Hairer & Wanner, Solving Ordinary Differential Equations II, ch. IV.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.pieces import is_free, segment_ends
from lobes.floquet.stages import gauss_stages
from lobes.tooth_force import force_shares, turned

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Applied, never multiplied out: each piece maps z and its own w to the new ones."""

    pieces: tuple[tuple[bool, Floats], ...]
    """Whether teeth cut, and the matrix, shape (r, d, m, m): m = 2n + nodes p in the cut, 2n else."""
    modes: int
    """Number of modes n."""
    nodes: int
    """Displacements in each piece in which teeth cut, stages times p."""

    @property
    def states(self) -> int:
        """Numbers in a state."""
        return 2 * self.modes + self.nodes * sum(cuts for cuts, _ in self.pieces)

    def __getitem__(self, which: tuple[NDArray[np.intp], NDArray[np.intp]]) -> PeriodMap:
        """Some of the cases, c of them, as rows of one depth each."""
        row, column = which
        pieces = ((cuts, matrix[row, column if cuts else 0][:, np.newaxis]) for cuts, matrix in self.pieces)
        return PeriodMap(tuple(pieces), self.modes, self.nodes)

    def __call__(self, state: Floats) -> Floats:
        """The states (r, d, states) one tooth period on."""
        z, parts, at = state[..., : 2 * self.modes], list[Floats](), 2 * self.modes
        for cuts, matrix in self.pieces:
            if cuts:
                z = np.concatenate((z, state[..., at : at + self.nodes]), axis=-1)
                at += self.nodes
            z = (matrix @ z[..., np.newaxis])[..., 0]
            if cuts:
                z, part = z[..., : 2 * self.modes], z[..., 2 * self.modes :]
                parts.append(part)
        return np.concatenate((z, *parts), axis=-1)


def period_map(rows: MillingRows, depth: Floats, numbers: NDArray[np.int64]) -> PeriodMap:
    """The map of each row at depths (r, d) in m; numbers (k,): pieces of each segment, the same in all rows.

    For helical teeth, whose segments depend on the depth, d is 1.
    """
    ends = segment_ends(rows.cut, depth[:, 0])
    free = is_free(rows.cut, ends, depth[:, 0])
    pieces = list[tuple[bool, Floats]]()
    for k in np.flatnonzero(numbers):
        number = int(numbers[k])
        angle = (ends[:, k + 1] - ends[:, k]) / number
        time = angle / (2 * np.pi / rows.cut.teeth) * rows.tooth_period
        if np.all(free[:, k]):
            pieces.append((False, _ringing(rows, number * time)[:, np.newaxis]))
        else:
            starts = ends[:, k, np.newaxis] + angle[:, np.newaxis] * np.arange(number)
            maps = _Response.of(rows, time).cutting(_forces(rows, starts, angle, depth))
            pieces += [(True, maps[:, :, i]) for i in range(number)]
    return PeriodMap(tuple(pieces), rows.direction.size, gauss_stages().node.size * rows.axes.size)


def _forces(rows: MillingRows, starts: Floats, angle: Floats, depth: Floats) -> Floats:
    """Depth times force matrix at the nodes of pieces that start at angles (r, k) (N/m), shape (r, d, k, s, p, p)."""
    apart = slice(None) if rows.cut.helix_lag > 0 else slice(1)  # straight teeth: the angles are those of the first row
    at = starts[apart, :, np.newaxis] + angle[apart, np.newaxis, np.newaxis] * gauss_stages().node
    shares = force_shares(rows.cut, at, depth[apart, :1])
    matrix = np.einsum("rc,rkscij->rksij", np.stack((rows.tangential, rows.radial), axis=1), shares)
    matrix = turned(matrix, rows.feed_angle[:, np.newaxis, np.newaxis])[..., rows.axes[:, np.newaxis], rows.axes]
    return np.asarray(depth[..., *([np.newaxis] * 4)] * matrix[:, np.newaxis])


def _ringing(rows: MillingRows, time: Floats) -> Floats:
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
class _Response:
    """What a piece of some length does to modes, before the cut closes the loop."""

    ends: Floats
    """z at the end from z at the begin, shape (r, 2n, 2n)."""
    shows: Floats
    """Displacements at the nodes from z at the begin, shape (r, p, s, 2n)."""
    gives: Floats
    """Displacements at the nodes from forces there, shape (r, p, s, s)."""
    pushes: Floats
    """z at the end from forces at the nodes, shape (r, 2n, p, s)."""

    @classmethod
    def of(cls, rows: MillingRows, time: Floats) -> _Response:
        """For pieces of a length (r,) in s."""
        node, weight, integral = gauss_stages()
        theta, zeta = (
            a[..., np.newaxis, np.newaxis] for a in (rows.frequency * time[:, np.newaxis], rows.damping_ratio)
        )
        solved = np.linalg.inv(np.eye(node.size) + 2 * zeta * theta * integral + theta**2 * (integral @ integral))
        velocity = np.concatenate((-theta * (solved @ node)[..., np.newaxis], solved.sum(-1, keepdims=True)), axis=-1)
        forced = solved @ integral * (theta / rows.stiffness[..., np.newaxis, np.newaxis])
        place = theta * (integral @ velocity) + [1.0, 0.0]
        yields = theta * (integral @ forced)
        q = theta * (weight @ velocity)[..., np.newaxis, :] + [[1.0, 0.0]]
        drive = -theta * (weight @ (place + 2 * zeta * velocity))[..., np.newaxis, :] + [[0.0, 1.0]]
        q_push = theta[..., 0] * (weight @ forced)
        v_push = theta[..., 0] * (weight / rows.stiffness[..., np.newaxis] - weight @ (yields + 2 * zeta * forced))
        shown, shown_forced = place, yields
        if np.any(rows.phase):
            of_place, of_velocity = (share[..., np.newaxis, np.newaxis] for share in rows.seen)
            shown = of_place * place + of_velocity * velocity
            shown_forced = of_place * yields + of_velocity * forced
        return cls(
            ends=_blocks(q[..., 0, 0], q[..., 0, 1], drive[..., 0, 0], drive[..., 0, 1]),
            shows=_by_direction(rows, shown),
            gives=np.einsum("rnij,np->rpij", shown_forced, _moves(rows)),
            pushes=np.concatenate([np.einsum("rns,np->rnps", push, _moves(rows)) for push in (q_push, v_push)], axis=1),
        )

    def cutting(self, force: Floats) -> Floats:
        """The maps (r, d, k, m, m) of k pieces with forces -force (d - w) at their nodes, force (r, d, k, s, p, p)."""
        *cases, s, p, _ = force.shape
        size, states = p * s, self.ends.shape[-1]
        forces = np.ascontiguousarray(np.moveaxis(force, -3, -1))
        loop, push = np.empty((*cases, size, size)), np.zeros((*cases, states, size))
        gives = self.gives[:, np.newaxis, np.newaxis, :, :, np.newaxis]
        np.multiply(gives, forces[..., np.newaxis, :, :], out=loop.reshape(*cases, p, s, p, s))
        i = np.arange(size)
        loop[..., i, i] += 1
        for direction in range(p):
            pushes = self.pushes[:, np.newaxis, np.newaxis, :, direction, np.newaxis]
            push.reshape(*cases, states, p, s)[...] += pushes * forces[..., np.newaxis, direction, :, :]
        inverse = np.linalg.inv(loop)
        maps = np.empty((*cases, states + size, states + size))
        np.matmul(inverse, self.shows.reshape(-1, 1, 1, size, states), out=maps[..., states:, :states])
        np.negative(inverse, out=maps[..., states:, states:])
        maps[..., :states, :] = np.negative(push, out=push) @ maps[..., states:, :]
        maps[..., :states, :states] += self.ends[:, np.newaxis, np.newaxis]
        maps[..., states + i, states + i] += 1
        return maps


def _moves(rows: MillingRows) -> Floats:
    """1 where a mode moves in a direction, shape (n, p)."""
    return np.asarray(np.eye(rows.axes.size)[rows.direction])


def _by_direction(rows: MillingRows, place: Floats) -> Floats:
    """Displacements from z: places (r, n, s, 2) of the modes, each in its own direction, shape (r, p, s, 2n)."""
    shown = np.einsum("rnsk,np->rpskn", place, _moves(rows))
    return np.asarray(shown.reshape(*shown.shape[:3], -1))
