"""The map of milling with teeth of unequal pitch over the pattern after which they repeat, piece by piece.

As `lobes.floquet.period_map`, but each tooth meets what the one before it left, a delay of its own ago:

    F(t) = -b sum_j H_j(t) (d(t) - d(t - tau_j))

The state is z and the displacements at the nodes of each piece of the last pattern in which teeth cut. No delay is
longer than the pattern, none shorter than a piece; within a piece the displacement is the polynomial through its nodes.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.stages import gauss_stages, polynomial_at

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surface:
    """What teeth of one delay meet in a piece."""

    first: int
    """First piece of the pattern in which it was cut ..."""
    last: int
    """... and the one after the last."""
    weights: Floats
    """Displacements at the piece's nodes from those at the nodes of these pieces, shape (r or 1, 1, nodes, s)."""
    force: Floats
    """Depth times force matrix of these teeth at the nodes (N/m), shape (r, d, p, p, s)."""

    def load(self, past: Floats) -> Floats:
        """Forces at the nodes (r, d, p, s) from the displacements of the pattern (r, d, p, pieces, s)."""
        met = past[..., self.first : self.last, :]
        *cases, pieces, nodes = met.shape
        if len(self.weights) > 1:
            left = np.matmul(met.reshape(*cases, pieces * nodes), self.weights)
        else:
            left = (met.reshape(-1, pieces * nodes) @ self.weights[0, 0]).reshape(*cases, -1)
        return np.asarray((self.force * left[:, :, np.newaxis]).sum(axis=3))

    def __getitem__(self, which: tuple[NDArray[np.intp], NDArray[np.intp]]) -> Surface:
        """For some of the cases, c of them, as rows of one depth each."""
        weights = self.weights[which[0]] if len(self.weights) > 1 else self.weights
        return Surface(self.first, self.last, weights, self.force[which][:, np.newaxis])


@dataclass(frozen=True, eq=False)
class UnevenPiece:
    """One piece of the pattern; without teeth in the cut it meets no surface."""

    matrix: Floats
    """From z and the forces of what was left to z and the displacements, shape (r, d, m, m); without of z alone."""
    surfaces: tuple[Surface, ...] = ()

    def __getitem__(self, which: tuple[NDArray[np.intp], NDArray[np.intp]]) -> UnevenPiece:
        """For some of the cases, c of them, as rows of one depth each."""
        row, column = which
        matrix = self.matrix[row, column if self.matrix.shape[1] > 1 else 0][:, np.newaxis]
        return UnevenPiece(matrix, tuple(surface[which] for surface in self.surfaces))


@dataclass(frozen=True, eq=False)
class UnevenMap:
    """Applied, never multiplied out."""

    pieces: tuple[UnevenPiece, ...]
    modes: int
    """Number of modes n."""
    directions: int
    """Number of directions p."""

    @property
    def kind(self) -> np.dtype[Any]:
        """Precision of its numbers."""
        return self.pieces[0].matrix.dtype

    @property
    def cutting(self) -> int:
        """Number of pieces in which teeth cut."""
        return sum(bool(piece.surfaces) for piece in self.pieces)

    @property
    def states(self) -> int:
        """Numbers in a state."""
        return 2 * self.modes + self.directions * self.cutting * gauss_stages().node.size

    def __getitem__(self, which: tuple[NDArray[np.intp], NDArray[np.intp]]) -> UnevenMap:
        """Some of the cases, c of them, as rows of one depth each."""
        return UnevenMap(tuple(piece[which] for piece in self.pieces), self.modes, self.directions)

    def __call__(self, state: Floats) -> Floats:
        """The states (r, d, states) one pattern on."""
        cases, z = state.shape[:-1], state[..., : 2 * self.modes]
        past = state[..., 2 * self.modes :].reshape(*cases, self.directions, self.cutting, -1).copy()
        at = 0
        for piece in self.pieces:
            if not piece.surfaces:
                z = (piece.matrix @ z[..., np.newaxis])[..., 0]
                continue
            load = functools.reduce(np.add, [surface.load(past) for surface in piece.surfaces])
            both = np.concatenate((z, load.reshape(*cases, -1)), axis=-1)
            both = (piece.matrix @ both[..., np.newaxis])[..., 0]
            z, new = both[..., : 2 * self.modes], both[..., 2 * self.modes :]
            past[..., at, :] = new.reshape(*cases, self.directions, -1)
            at += 1
        return np.concatenate((z, past.reshape(*cases, -1)), axis=-1)


def surfaces(
    delays: tuple[float, ...], turn: float, starts: Floats, lengths: Floats, forces: Floats
) -> Iterator[tuple[Surface, ...]]:
    """What the teeth of each delay (rad) meet in each piece in which any cut.

    The pieces start at angles (r or 1, k) and are as long (rad) in a pattern of `turn` (rad); forces: depth times force
    matrix of the teeth of each delay at the nodes (N/m), shape (delays, p, p, s, k, r, d).
    """
    node = starts[..., np.newaxis] + lengths[..., np.newaxis] * gauss_stages().node
    met = [_met(np.mod(node - delay, turn), starts, lengths) for delay in delays]
    forces = np.moveaxis(forces, (5, 6, 4), (1, 2, 3))
    cut = np.any(forces, axis=(1, 2, 4, 5, 6))
    for k in range(starts.shape[1]):
        yield tuple(Surface(*met[i][k], forces[i, :, :, k]) for i in np.flatnonzero(cut[:, k]))


def _met(angle: Floats, starts: Floats, lengths: Floats) -> list[tuple[int, int, Floats]]:
    """For each piece that pieces its nodes' angles (r or 1, k, s) lie in, first and one after the last, and weights."""
    rows = np.arange(len(starts))[:, np.newaxis, np.newaxis]
    piece = np.maximum(np.sum(starts[:, np.newaxis, np.newaxis] <= angle[..., np.newaxis], axis=-1) - 1, 0)
    within = np.clip((angle - starts[rows, piece]) / lengths[rows, piece], 0.0, 1.0)
    own = np.swapaxes(polynomial_at(within), 2, 3)
    first, last = np.min(piece, axis=(0, 2)), np.max(piece, axis=(0, 2)) + 1
    return [
        (int(a), int(b), _spread(own[:, k], piece[:, k] - a, b - a))
        for k, (a, b) in enumerate(zip(first, last, strict=True))
    ]


def _spread(own: Floats, piece: NDArray[np.intp], number: int) -> Floats:
    """Weights (r, m, s) of the nodes of one piece for each of s angles, among those of `number` pieces (r, 1, ., s)."""
    is_own = np.arange(number)[:, np.newaxis, np.newaxis] == piece[:, np.newaxis, np.newaxis]
    return np.where(is_own, own[:, np.newaxis], 0.0).reshape(len(own), 1, -1, piece.shape[1])
