"""Response of the modes over one piece of time in a cut with process damping.

With the forces f at the nodes, the displacements d = a z + G f and the velocities u = c z + J f there, the cut closes
the loop f = -H (d - w) - B u: (1 + H G + B J) f = H w - (H a + B c) z. H and B: depth times force and damping matrix.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.piece_response import PieceResponse, Precision, gauss_nodes, weighted_sums
from modal.arrays import Floats


@dataclass(frozen=True, eq=False)
class DampedResponse:
    """Response over a piece with the velocities of the tip, before the cut closes the loop."""

    piece: PieceResponse
    """End state and displacements."""
    node_velocity: Floats
    """Velocities at the nodes from z at the begin, shape (r, p, s, 2n)."""
    node_mobility: Floats
    """Velocities at the nodes from forces there, shape (r, p, p, s, s)."""

    @classmethod
    def of(cls, rows: MillingRows, time: Floats) -> Self:
        """Compute the response over pieces of a length (r,) in s.

        The velocity of a complex mode is that of free motion, q'' = -2 zeta w q' - w^2 q: truncated complex modes jump
        with a force.
        """
        nodes = gauss_nodes()
        theta, zeta = rows.frequency * time[:, np.newaxis], rows.damping_ratio
        t = theta[..., np.newaxis] * nodes.root
        x = 1 / (1 + 2 * zeta[..., np.newaxis] * t + t**2)
        begin, ones, per_theta = nodes.share @ nodes.node, nodes.share.sum(axis=-1), theta[..., np.newaxis]
        place = np.stack((1 - per_theta * weighted_sums(t * x, begin), weighted_sums(t * x, ones)), axis=-1)
        velocity = np.stack((-per_theta * weighted_sums(x, begin), weighted_sums(x, ones)), axis=-1)
        of_place, of_velocity = rows.tip_participation
        by_velocity, by_place = (
            share[..., np.newaxis] * rows.frequency[..., np.newaxis]
            for share in (of_place - 2 * zeta * of_velocity, -of_velocity)
        )
        shown = by_velocity[..., np.newaxis] * velocity + by_place[..., np.newaxis] * place
        forced = (by_velocity + by_place * t) * t * x / rows.stiffness[..., np.newaxis]
        mobile = np.einsum("rnk,rnp,rnq->rpqk", forced, rows.vector, rows.vector)
        at_nodes = np.einsum("rnsk,rnp->rpskn", shown, rows.vector)
        at_nodes = at_nodes.reshape(*at_nodes.shape[:3], -1)
        return cls(PieceResponse.of(rows, time), at_nodes, weighted_sums(mobile, nodes.share))

    def as_precision(self, kind: Precision) -> Self:
        """Return the response with numbers of another precision."""
        numbers: dict[str, Any] = {
            name: getattr(self, name).astype(kind) for name in ("node_velocity", "node_mobility")
        }
        return replace(self, piece=self.piece.as_precision(kind), **numbers)

    def cutting(self, force: Floats, damping: Floats) -> Floats:
        """Return the maps (k, r, d, m, m) of k pieces with forces -force (d - w) - damping u at their nodes.

        force, damping (p, p, s, k, r, d). From z and w at the begin to z at the end and d.
        """
        held = _node_matrices(force)
        answer, by_state = self._closed(held, _node_matrices(damping))
        return self._maps(by_state, answer @ held)

    def loaded(self, force: Floats, damping: Floats) -> Floats:
        """Return the maps (k, r, d, m, m) of k pieces with forces f - force d - damping u at their nodes.

        force, damping (p, p, s, k, r, d). From z at the begin and f to z at the end and d.
        """
        answer, by_state = self._closed(_node_matrices(force), _node_matrices(damping))
        return self._maps(by_state, answer)

    def _closed(self, held: Floats, damped: Floats) -> tuple[Floats, Floats]:
        """Return forces at the nodes by those given in addition (k, r, d, ps, ps), and by z (k, r, d, ps, 2n)."""
        piece, size = self.piece, held.shape[-1]
        loop = held @ _paired_nodes(piece.node_flexibility) + damped @ _paired_nodes(self.node_mobility)
        loop[..., np.arange(size), np.arange(size)] += 1
        answer, states = np.asarray(np.linalg.inv(loop)), piece.end_state.shape[-1]
        shown, moving = (part.reshape(-1, 1, size, states) for part in (piece.node_displacement, self.node_velocity))
        return answer, -answer @ (held @ shown + damped @ moving)

    def _maps(self, by_state: Floats, by_given: Floats) -> Floats:
        """Return maps from z and the given node values to z at the end and d."""
        piece, size, states = self.piece, by_given.shape[-1], by_state.shape[-1]
        push = piece.end_state_per_force.reshape(-1, 1, states, size)
        pushes = np.concatenate((push, _paired_nodes(piece.node_flexibility)), axis=-2)
        maps = np.asarray(pushes @ np.concatenate((by_state, by_given), axis=-1))
        maps[..., :states, :states] += piece.end_state[:, np.newaxis]
        maps[..., states:, :states] += piece.node_displacement.reshape(-1, 1, size, states)
        return maps


def _paired_nodes(values: Floats) -> Floats:
    """Reorder values (r, p, p, s, s) of node pairs to matrices (r, 1, ps, ps)."""
    size = values.shape[1] * values.shape[3]
    return np.moveaxis(values, 2, 3).reshape(-1, 1, size, size)


def _node_matrices(values: Floats) -> Floats:
    """Return matrices (k, r, d, ps, ps) that act at each node as values (p, p, s, k, r, d)."""
    p, _, s, *cases = values.shape
    matrices = np.zeros((*cases, p, s, p, s), values.dtype)
    for node in range(s):
        matrices[..., node, :, node] = np.moveaxis(values[:, :, node], (0, 1), (-2, -1))
    return matrices.reshape(*cases, p * s, p * s)
