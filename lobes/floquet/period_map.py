"""Map of milling over one tooth period, or over the pattern of unequal pitches.

The state is z, for each mode its coordinate q and its velocity over its frequency, and the displacements w of the tool
tip one period ago at the Gauss nodes of each piece in which teeth cut. Within a piece q is a polynomial through its
nodes: w is known there, since the pieces of every period are the same, so nothing is interpolated. Without teeth in
the cut the modes vibrate freely, exactly. For r rows and d depths:

    z (r, d, 2n), w (r, d, nodes p), p directions      theta = w_n times the length of a piece
    D = (1 + 2 zeta theta A + theta^2 A^2)^-1          A integrates from the begin of the piece to its nodes
    velocity = D (p_0 - theta c q_0 + theta/K A force),  q = q_0 + theta A velocity
    displacement = vector q, of a complex mode vector times its shares of q and velocity
    (`MillingRows.tip_participation`);  force = vector . F

Process damping adds -b C / V n n' (d tip / dt) for each tooth, n the normal of the surface (`DampedResponse`).

With unequal pitches each tooth meets the surface that the previous tooth left a delay of its own ago:

    F(t) = -b sum_j H_j(t) (d(t) - d(t - tau_j))

The state is z and the displacements at the nodes of each piece of the last pattern in which teeth cut. No delay is
longer than the pattern, none shorter than a piece; within a piece the displacement is the polynomial through its nodes.

Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, ch. 3, with polynomials of degree
7 instead of 1 for the delayed term; Hairer & Wanner, Solving Ordinary Differential Equations II, ch. IV.5.
"""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lobes.floquet.damped_response import DampedResponse
from lobes.floquet.milling_rows import MillingRows, is_out_of_cut, segment_ends
from lobes.floquet.piece_response import PieceResponse, Precision, free_response, gauss_nodes, interpolation_weights
from lobes.tooth_force import feed_rotation, force_shares
from modal.arrays import Floats, Indices, Integers


@dataclass(frozen=True, eq=False)
class RegeneratedSurface:
    """Surface that teeth of one delay meet in a piece."""

    first: int
    """First piece of the pattern in which it was cut."""
    last: int
    """Piece after the last one in which it was cut."""
    weights: Floats
    """Weights from the displacements at their nodes to the nodes of this piece, shape (r or 1, 1, nodes, s)."""
    force: Floats
    """Depth times force matrix of these teeth at the nodes (N/m), shape (r, d, p, p, s)."""

    def load(self, past: Floats) -> Floats:
        """Return forces at the nodes (r, d, p, s) from the displacements of the pattern (r, d, p, pieces, s)."""
        met = past[..., self.first : self.last, :]
        *cases, pieces, nodes = met.shape
        if len(self.weights) > 1:
            left = np.matmul(met.reshape(*cases, pieces * nodes), self.weights)
        else:
            left = (met.reshape(-1, pieces * nodes) @ self.weights[0, 0]).reshape(*cases, -1)
        return np.asarray((self.force * left[:, :, np.newaxis]).sum(axis=3))

    def __getitem__(self, which: tuple[Indices, Indices]) -> "RegeneratedSurface":
        """Select c of the cases as rows of one depth each."""
        weights = self.weights[which[0]] if len(self.weights) > 1 else self.weights
        return RegeneratedSurface(self.first, self.last, weights, self.force[which][:, np.newaxis])


@dataclass(frozen=True, eq=False)
class UnevenPiece:
    """Piece of the pattern; it meets no surface if no tooth cuts."""

    matrix: Floats
    """Map from z and surface forces to z and displacements, shape (r, d, m, m); of z alone without a cut."""
    surfaces: tuple[RegeneratedSurface, ...] = ()

    def __getitem__(self, which: tuple[Indices, Indices]) -> "UnevenPiece":
        """Select c of the cases as rows of one depth each."""
        row, column = which
        matrix = self.matrix[row, column if self.matrix.shape[1] > 1 else 0][:, np.newaxis]
        return UnevenPiece(matrix, tuple(surface[which] for surface in self.surfaces))


@dataclass(frozen=True, eq=False)
class UnevenMap:
    """Map over the pattern of unequal pitches, applied piece by piece."""

    pieces: tuple[UnevenPiece, ...]
    modes: int
    """Number of modes n."""
    directions: int
    """Number of directions p."""

    @property
    def cutting(self) -> int:
        """Number of pieces in which teeth cut."""
        return sum(bool(piece.surfaces) for piece in self.pieces)

    @property
    def zero_state(self) -> Floats:
        """State of zeros, shape (states,), in the precision of the matrices."""
        size = 2 * self.modes + self.directions * self.cutting * gauss_nodes().node.size
        return np.zeros(size, self.pieces[0].matrix.dtype)

    def __getitem__(self, which: tuple[Indices, Indices]) -> "UnevenMap":
        """Select c of the cases as rows of one depth each."""
        return UnevenMap(tuple(piece[which] for piece in self.pieces), self.modes, self.directions)

    def __call__(self, state: Floats) -> Floats:
        """Return the states (r, d, states) one pattern later."""
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


def regenerated_surfaces(
    delays: tuple[float, ...], turn: float, starts: Floats, lengths: Floats, forces: Floats
) -> Iterator[tuple[RegeneratedSurface, ...]]:
    """Yield the surfaces that the teeth of each delay (rad) meet in each piece with a cut.

    The pieces start at angles (r or 1, k) and have lengths (rad) in a pattern of `turn` (rad); forces: depth times
    force
    matrix of the teeth of each delay at the nodes (N/m), shape (delays, p, p, s, k, r, d).
    """
    node = starts[..., np.newaxis] + lengths[..., np.newaxis] * gauss_nodes().node
    met = [_locate_angles(np.mod(node - delay, turn), starts, lengths) for delay in delays]
    forces = np.moveaxis(forces, (5, 6, 4), (1, 2, 3))
    cut = np.any(forces, axis=(1, 2, 4, 5, 6))
    for k in range(starts.shape[1]):
        yield tuple(RegeneratedSurface(*met[i][k], forces[i, :, :, k]) for i in np.flatnonzero(cut[:, k]))


def _locate_angles(angle: Floats, starts: Floats, lengths: Floats) -> list[tuple[int, int, Floats]]:
    """Return first piece, one after the last, and weights, for each piece of node angles (r or 1, k, s)."""
    rows = np.arange(len(starts))[:, np.newaxis, np.newaxis]
    piece = np.maximum(np.sum(starts[:, np.newaxis, np.newaxis] <= angle[..., np.newaxis], axis=-1) - 1, 0)
    within = np.clip((angle - starts[rows, piece]) / lengths[rows, piece], 0.0, 1.0)
    own = np.swapaxes(interpolation_weights(within), 2, 3)
    first, last = np.min(piece, axis=(0, 2)), np.max(piece, axis=(0, 2)) + 1
    ranges = enumerate(zip(first, last, strict=True))
    return [(int(a), int(b), _spread_weights(own[:, k], piece[:, k] - a, b - a)) for k, (a, b) in ranges]


def _spread_weights(own: Floats, piece: Indices, number: int) -> Floats:
    """Place the node weights (r, m, s) of single pieces among those of `number` pieces, shape (r, 1, ., s)."""
    is_own = np.arange(number)[:, np.newaxis, np.newaxis] == piece[:, np.newaxis, np.newaxis]
    return np.where(is_own, own[:, np.newaxis], 0.0).reshape(len(own), 1, -1, piece.shape[1])


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Map over one tooth period, applied piece by piece: each piece maps z and its own w to the new ones."""

    pieces: tuple[tuple[bool, Floats], ...]
    """Pieces: True if teeth cut, and the matrix, shape (r, d, m, m); m = 2n + nodes p in the cut, else 2n."""
    modes: int
    """Number of modes n."""
    nodes: int
    """Displacements in each piece with a cut, nodes times p."""

    @property
    def zero_state(self) -> Floats:
        """State of zeros, shape (states,), in the precision of the matrices."""
        return np.zeros(2 * self.modes + self.nodes * sum(cuts for cuts, _ in self.pieces), self.pieces[0][1].dtype)

    def __getitem__(self, which: tuple[Indices, Indices]) -> "PeriodMap":
        """Select c of the cases as rows of one depth each."""
        row, column = which
        pieces = ((cuts, matrix[row, column if cuts else 0][:, np.newaxis]) for cuts, matrix in self.pieces)
        return PeriodMap(tuple(pieces), self.modes, self.nodes)

    def __call__(self, state: Floats) -> Floats:
        """Return the states (r, d, states) one tooth period later."""
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


AnyMap = PeriodMap | UnevenMap
"""Map of a state over a period of evenly or unevenly spaced teeth."""


def build_period_map(rows: MillingRows, depth: Floats, numbers: Integers, kind: Precision) -> AnyMap:
    """Build the map of each row at depths (r, d) in m; numbers (k,): pieces of each segment, equal in all rows.

    For helical teeth, whose segments depend on the depth, d is 1. kind: precision; uneven teeth use double.
    """
    ends = segment_ends(rows.cut, depth[:, 0])
    free = np.all(is_out_of_cut(rows.cut, ends, depth[:, 0]), axis=0)
    used = [(ends[:, k : k + 2], int(numbers[k]), bool(free[k])) for k in np.flatnonzero(numbers)]
    segments = [_Segment.of(rows, depth, *segment) for segment in used]
    return _uneven_map(rows, segments) if rows.cut.pitch else _even_map(rows, segments, kind)


@dataclass(frozen=True, eq=False)
class _Segment:
    """Pieces of one length, all with the same teeth in the cut."""

    starts: Floats
    """Start angles (rad), shape (r, k)."""
    angle: Floats
    """Angle of each (rad), shape (r,)."""
    time: Floats
    """Time of each (s), shape (r,)."""
    forces: Floats | None
    """Depth times force matrix at the nodes (N/m), shape (delays, p, p, s, k, r, d); None without a cut."""
    damping: Floats | None
    """Depth times process damping matrix at the nodes (N s/m), shape (p, p, s, k, r, d); None without damping."""

    @classmethod
    def of(cls, rows: MillingRows, depth: Floats, ends: Floats, number: int, is_free: bool) -> "_Segment":
        angle = (ends[:, 1] - ends[:, 0]) / number
        starts = ends[:, :1] + angle[:, np.newaxis] * np.arange(number)
        time = angle / sum(rows.cut.pitch_pattern) * rows.period
        if is_free:
            return cls(starts, angle, time, None, None)
        forces = _force_matrices(rows, starts, angle, depth, np.stack((rows.tangential, rows.radial), axis=1))
        if not np.any(rows.process_damping):
            return cls(starts, angle, time, forces, None)
        normal = np.stack((np.zeros(len(rows)), rows.damping_per_depth), axis=1)
        return cls(starts, angle, time, forces, _force_matrices(rows, starts, angle, depth, normal).sum(axis=0))

    def free_response(self, rows: MillingRows) -> Floats:
        """Return the map of z over all pieces without a cut, shape (r, 1, 2n, 2n)."""
        return free_response(rows, self.starts.shape[1] * self.time)[:, np.newaxis]


def _even_map(rows: MillingRows, segments: Sequence[_Segment], kind: Precision) -> PeriodMap:
    pieces = list[tuple[bool, Floats]]()
    for segment in segments:
        if segment.forces is None:
            pieces.append((False, segment.free_response(rows).astype(kind)))
        else:
            pieces += [(True, piece) for piece in _cutting_maps(rows, segment, kind)]
    return PeriodMap(tuple(pieces), rows.direction.size, gauss_nodes().node.size * rows.axes.size)


def _cutting_maps(rows: MillingRows, segment: _Segment, kind: Precision) -> Floats:
    """Return the maps of even teeth over the pieces of a segment with a cut (k, r, d, m, m)."""
    forces = np.asarray(segment.forces)[0].astype(kind)
    if segment.damping is None:
        return PieceResponse.of(rows, segment.time).as_precision(kind).cutting(forces)
    return DampedResponse.of(rows, segment.time).as_precision(kind).cutting(forces, segment.damping.astype(kind))


def _loaded_maps(rows: MillingRows, segment: _Segment) -> Floats:
    """Return the maps of uneven teeth over the pieces of a segment with a cut (k, r, d, m, m)."""
    forces = np.asarray(segment.forces).sum(axis=0)
    if segment.damping is None:
        return PieceResponse.of(rows, segment.time).loaded(forces)
    return DampedResponse.of(rows, segment.time).loaded(forces, segment.damping)


def _uneven_map(rows: MillingRows, segments: Sequence[_Segment]) -> UnevenMap:
    apart = slice(None) if rows.cut.helix_lag > 0 else slice(1)  # straight teeth: the angles are those of the first row
    cutting = [segment for segment in segments if segment.forces is not None]
    starts = np.hstack([segment.starts[apart] for segment in cutting])
    lengths = np.hstack([np.repeat(s.angle[apart, np.newaxis], s.starts.shape[1], 1) for s in cutting])
    forces = np.concatenate([segment.forces for segment in cutting if segment.forces is not None], axis=4)
    met = regenerated_surfaces(rows.cut.delays, sum(rows.cut.pitch_pattern), starts, lengths, forces)
    pieces = list[UnevenPiece]()
    for segment in segments:
        if segment.forces is None:
            pieces.append(UnevenPiece(segment.free_response(rows)))
        else:
            pieces += [UnevenPiece(piece, next(met)) for piece in _loaded_maps(rows, segment)]
    return UnevenMap(tuple(pieces), rows.direction.size, rows.axes.size)


def _force_matrices(rows: MillingRows, starts: Floats, angle: Floats, depth: Floats, coefficients: Floats) -> Floats:
    """Return depth times force matrix of the teeth of each delay at the nodes of pieces.

    The pieces start at angles (r, k). coefficients (r, 2): along the cut and normal to it, Kt and Kr in Pa for a matrix
    in N/m. Shape (delays, p, p, s, k, r, d).
    """
    is_alike = rows.cut.helix_lag == 0 or bool(np.all(depth[:, 0] == depth[0, 0]))
    apart = slice(1) if is_alike else slice(None)  # the angles are those of the first row
    at = starts[apart, :, np.newaxis] + angle[apart, np.newaxis, np.newaxis] * gauss_nodes().node
    shares = force_shares(rows.cut, at, depth[apart, :1])
    frame = feed_rotation(rows.feed_angle)[..., rows.axes]
    by_share = np.einsum("rc,rmi,rnj->rcmnij", coefficients, frame, frame).reshape(len(rows), 8, -1)
    matrix = shares.reshape(*shares.shape[:2], -1, 8) @ by_share
    matrix = matrix.reshape(*matrix.shape[:2], *at.shape[1:], *[rows.axes.size] * 2)
    return np.asarray(np.multiply(np.moveaxis(matrix, (1, 2, 3), (5, 4, 3))[..., np.newaxis], depth, order="C"))
