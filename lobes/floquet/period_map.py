"""The map of milling over one tooth period, piece by piece.

The state is z, for each mode its coordinate q and its velocity over its frequency, and the displacements w of the tool
tip one period ago at the Gauss nodes of each piece in which teeth cut. Within a piece q is a polynomial through its
nodes: w is known there, since the pieces of every period are the same, so nothing is interpolated. Without teeth in
the cut the modes ring freely, exactly. For r rows and d depths:

    z (r, d, 2n), w (r, d, nodes p), p directions      theta = w_n times the length of a piece
    D = (1 + 2 zeta theta A + theta^2 A^2)^-1          A integrates from the begin of the piece to its nodes
    velocity = D (p_0 - theta c q_0 + theta/K A force),  q = q_0 + theta A velocity
    displacement = vector q, of a complex mode vector times its shares of q and velocity (`MillingRows.seen`);
    force = vector . F

Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, ch. 3, with polynomials of degree
7 instead of 1 for the delayed term; Hairer & Wanner, Solving Ordinary Differential Equations II, ch. IV.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.piece_response import PieceResponse, ringing
from lobes.floquet.pieces import is_free, segment_ends
from lobes.floquet.stages import gauss_stages
from lobes.floquet.uneven_map import UnevenMap, UnevenPiece, surfaces
from lobes.tooth_force import force_shares, turns

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
    def kind(self) -> np.dtype[Any]:
        """Precision of its numbers."""
        return self.pieces[0][1].dtype

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


def period_map(
    rows: MillingRows, depth: Floats, numbers: NDArray[np.int64], kind: type[np.floating[Any]] = np.float64
) -> PeriodMap | UnevenMap:
    """The map of each row at depths (r, d) in m; numbers (k,): pieces of each segment, the same in all rows.

    For helical teeth, whose segments depend on the depth, d is 1. kind: precision; that of uneven teeth is double.
    """
    ends = segment_ends(rows.cut, depth[:, 0])
    free = is_free(rows.cut, ends, depth[:, 0])
    segments = [
        _Segment.of(rows, depth, ends[:, k : k + 2], int(numbers[k]), bool(np.all(free[:, k])))
        for k in np.flatnonzero(numbers)
    ]
    return _uneven_map(rows, segments) if rows.cut.pitch else _even_map(rows, segments, kind)


@dataclass(frozen=True, eq=False)
class _Segment:
    """Pieces of one length, all with the same teeth in the cut."""

    starts: Floats
    """Angles at which they start (rad), shape (r, k)."""
    angle: Floats
    """Angle of each (rad), shape (r,)."""
    time: Floats
    """Time of each (s), shape (r,)."""
    forces: Floats | None
    """Depth times force matrix at their nodes (N/m), shape (delays, p, p, s, k, r, d); None where no tooth cuts."""

    @classmethod
    def of(cls, rows: MillingRows, depth: Floats, ends: Floats, number: int, is_free: bool) -> _Segment:
        angle = (ends[:, 1] - ends[:, 0]) / number
        starts = ends[:, :1] + angle[:, np.newaxis] * np.arange(number)
        time = angle / sum(rows.cut.pattern) * rows.period
        return cls(starts, angle, time, None if is_free else _forces(rows, starts, angle, depth))

    def ringing(self, rows: MillingRows) -> Floats:
        """Map of z over all pieces without a cut, shape (r, 1, 2n, 2n)."""
        return ringing(rows, self.starts.shape[1] * self.time)[:, np.newaxis]


def _even_map(rows: MillingRows, segments: Sequence[_Segment], kind: type[np.floating[Any]]) -> PeriodMap:
    pieces = list[tuple[bool, Floats]]()
    for segment in segments:
        if segment.forces is None:
            pieces.append((False, segment.ringing(rows).astype(kind)))
        else:
            maps = PieceResponse.of(rows, segment.time).rounded(kind).cutting(segment.forces[0].astype(kind))
            pieces += [(True, piece) for piece in maps]
    return PeriodMap(tuple(pieces), rows.direction.size, gauss_stages().node.size * rows.axes.size)


def _uneven_map(rows: MillingRows, segments: Sequence[_Segment]) -> UnevenMap:
    apart = slice(None) if rows.cut.helix_lag > 0 else slice(1)  # straight teeth: the angles are those of the first row
    cutting = [segment for segment in segments if segment.forces is not None]
    starts = np.hstack([segment.starts[apart] for segment in cutting])
    lengths = np.hstack(
        [np.repeat(segment.angle[apart, np.newaxis], segment.starts.shape[1], 1) for segment in cutting]
    )
    forces = np.concatenate([segment.forces for segment in cutting if segment.forces is not None], axis=4)
    met = surfaces(rows.cut.delays, sum(rows.cut.pattern), starts, lengths, forces)
    pieces = list[UnevenPiece]()
    for segment in segments:
        if segment.forces is None:
            pieces.append(UnevenPiece(segment.ringing(rows)))
        else:
            maps = PieceResponse.of(rows, segment.time).loaded(segment.forces.sum(axis=0))
            pieces += [UnevenPiece(piece, next(met)) for piece in maps]
    return UnevenMap(tuple(pieces), rows.direction.size, rows.axes.size)


def _forces(rows: MillingRows, starts: Floats, angle: Floats, depth: Floats) -> Floats:
    """Depth times force matrix of the teeth of each delay at the nodes of pieces that start at angles (r, k) (N/m).

    Shape (delays, p, p, s, k, r, d).
    """
    is_alike = rows.cut.helix_lag == 0 or bool(np.all(depth[:, 0] == depth[0, 0]))
    apart = slice(1) if is_alike else slice(None)  # the angles are those of the first row
    at = starts[apart, :, np.newaxis] + angle[apart, np.newaxis, np.newaxis] * gauss_stages().node
    shares = force_shares(rows.cut, at, depth[apart, :1])
    frame, coefficients = turns(rows.feed_angle)[..., rows.axes], np.stack((rows.tangential, rows.radial), axis=1)
    by_share = np.einsum("rc,rmi,rnj->rcmnij", coefficients, frame, frame).reshape(len(rows), 8, -1)
    matrix = shares.reshape(*shares.shape[:2], -1, 8) @ by_share
    matrix = matrix.reshape(*matrix.shape[:2], *at.shape[1:], *[rows.axes.size] * 2)
    return np.asarray(np.multiply(np.moveaxis(matrix, (1, 2, 3), (5, 4, 3))[..., np.newaxis], depth, order="C"))
