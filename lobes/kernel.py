"""The compiled part of semi-discretisation: a small projection of the map over one tooth period.

Importing this module imports numba. Time runs in intervals, coordinates are mass-normalised and divided by the largest
of their mode shapes at the tool tip, so that all numbers are near 1. Symbols, for n modes in p directions:

    q (n,)     modal coordinates, q'' + damping q' + stiffness q = -shape force (d - w)
    d (p,)     displacement of the tool tip, the sum of shape q over the modes of one direction
    w (p,)     d one tooth period of m intervals ago, linear within each interval
    z (2n,)    q and q'
    state      z and the m displacements of the period that is over, shape (2n + m p,)
    steps      maps from z, w at the begin and w at the end of each interval to z at its end, transposed,
               shape (m, 2n + 2p, 2n)
"""

# ruff: noqa: ANN001
from __future__ import annotations

import numpy as np
from numba import njit

REACH = 1.0
"""Largest angle (rad) of one Taylor series; beyond, the interval is halved and its map squared."""
ROUNDING = 1e-17
"""Taylor series end with the first term below this."""


@njit(cache=True, nogil=True)
def hessenberg(damping, stiffness, shape, direction, force, which, gain, start, warm_up, out):  # type: ignore[no-untyped-def]
    """Fill out (s, d, k + 1, k) with the Hessenberg matrices of k Arnoldi steps after `warm_up` power steps.

    damping, stiffness (s, n); shape, direction (n,); case (s, d) has the forces gain[s, d] force[which[s, d]] of
    force (c, m, p, p); start: a state.
    """
    n, (_, m, p, _) = shape.size, force.shape
    steps = np.empty((m, 2 * n + 2 * p, 2 * n))
    basis = np.empty((out.shape[2], start.size))
    work = np.empty((4, max(2 * n, p), 2 * n + 2 * p))
    for i in range(gain.shape[0]):
        for j in range(gain.shape[1]):
            one = force[which[i, j]]
            for k in range(m):
                if k > 0 and _same(one[k], one[k - 1]):
                    steps[k] = steps[k - 1]
                else:
                    _interval(damping[i], stiffness[i], shape, direction, one[k], gain[i, j], work, steps[k])
            basis[0] = start
            for _ in range(warm_up):
                _over_period(steps, shape, direction, basis[0], basis[1])
                basis[0] = basis[1] / _norm(basis[1])
            _arnoldi(steps, shape, direction, basis, out[i, j])


@njit(cache=True, nogil=True)
def _norm(vector):  # type: ignore[no-untyped-def]
    total = 0.0
    for value in vector:
        total += value * value
    return np.sqrt(total)


@njit(cache=True, nogil=True)
def _same(one, other):  # type: ignore[no-untyped-def]
    for a in range(one.shape[0]):
        for b in range(one.shape[1]):
            if one[a, b] != other[a, b]:
                return False
    return True


@njit(cache=True, nogil=True)
def _interval(damping, stiffness, shape, direction, force, scale, work, out):  # type: ignore[no-untyped-def]
    """Fill out (2n + 2p, 2n) with the map over one interval."""
    n, p = shape.size, force.shape[0]
    largest, sum_of_squares = 0.0, 0.0
    for a in range(n):
        largest = max(largest, stiffness[a] + damping[a] ** 2)
        sum_of_squares += shape[a] ** 2
    strongest = 0.0
    for a in range(p):
        for b in range(p):
            strongest += abs(force[a, b]) * scale
    angle = np.sqrt(largest + strongest * sum_of_squares)
    h, halvings = 1.0, 0
    while angle * h > REACH:
        h, halvings = h / 2, halvings + 1
    terms, size = 2, angle * h
    while size > ROUNDING:
        terms, size = terms + 1, size * angle * h / terms
    total = work[3]
    _taylor(damping, stiffness, shape, direction, force, scale, h, terms, work, total)
    for c in range(2 * n + 2 * p):
        to = h if n <= c < 2 * n or c >= 2 * n + p else 1.0
        for a in range(n):
            out[c, a] = total[a, c] * to
            out[c, n + a] = total[n + a, c] * to / h
    for _ in range(halvings):
        _double(out, n, p, h)
        h *= 2
    for c in range(p):
        for a in range(2 * n):
            out[2 * n + c, a] -= out[2 * n + p + c, a]


@njit(cache=True, nogil=True)
def _taylor(damping, stiffness, shape, direction, force, scale, h, terms, work, out):  # type: ignore[no-untyped-def]
    """q and h q' after time h from q, h q', w at the begin and h times the slope of w: out (2n, 2n + 2p)."""
    n, p = shape.size, force.shape[0]
    columns = 2 * n + 2 * p
    term, pull, thrust = work[0], work[1], work[2]
    for a in range(2 * n):
        for c in range(columns):
            term[a, c] = out[a, c] = 1.0 if a == c else 0.0
    for a in range(n):
        out[a, n + a] = 1.0
    for k in range(terms):
        for r in range(p):
            for c in range(columns):
                pull[r, c] = -1.0 if k < 2 and c == 2 * n + k * p + r else 0.0
        for a in range(n):
            for c in range(columns):
                pull[direction[a], c] += shape[a] * term[a, c]
        share = 1.0 / ((k + 1) * (k + 2))
        for r in range(p):
            for c in range(columns):
                thrust[r, c] = 0.0
            for s in range(p):
                weight = force[r, s] * scale * h * h * share
                for c in range(columns):
                    thrust[r, c] += weight * pull[s, c]
        for a in range(n):
            slow, pull_back, r = damping[a] * h / (k + 2), stiffness[a] * h * h * share, direction[a]
            for c in range(columns):
                new = -slow * term[n + a, c] - pull_back * term[a, c] - shape[a] * thrust[r, c]
                term[a, c] = term[n + a, c]
                term[n + a, c] = new
                out[a, c] += new
                out[n + a, c] += (k + 2) * new


@njit(cache=True, nogil=True)
def _double(steps, n, p, h):  # type: ignore[no-untyped-def]
    """Turn the transposed map over time h (from z, w and the slope of w) into the one over 2h."""
    first = steps.copy()
    for c in range(2 * n + 2 * p):
        for r in range(2 * n):
            total = 0.0
            for k in range(2 * n):
                total += first[c, k] * first[k, r]
            if c >= 2 * n:
                total += first[c, r]
            if c >= 2 * n + p:
                total += h * first[c - p, r]
            steps[c, r] = total


@njit(cache=True, nogil=True)
def _over_period(steps, shape, direction, state, out):  # type: ignore[no-untyped-def]
    """Fill out with the state one tooth period on."""
    m, columns, rows = steps.shape
    n, p = rows // 2, (columns - rows) // 2
    z, after = state[:rows].copy(), np.empty(rows)
    out[rows:] = 0.0
    for a in range(n):
        out[rows + direction[a]] += shape[a] * z[a]
    for i in range(m):
        begin = rows + i * p
        for r in range(rows):
            after[r] = 0.0
        for c in range(rows):
            for r in range(rows):
                after[r] += steps[i, c, r] * z[c]
        for c in range(p):
            was = state[begin + c]
            for r in range(rows):
                after[r] += steps[i, rows + c, r] * was
        for c in range(p):
            was = state[begin + p + c] if i < m - 1 else out[rows + c]
            for r in range(rows):
                after[r] += steps[i, rows + p + c, r] * was
        z, after = after, z
        if i < m - 1:
            for a in range(n):
                out[begin + p + direction[a]] += shape[a] * z[a]
    out[:rows] = z


@njit(cache=True, nogil=True)
def _arnoldi(steps, shape, direction, basis, out):  # type: ignore[no-untyped-def]
    """Fill out (k + 1, k) with the Hessenberg matrix from the first row of basis (k + 1, states)."""
    out[:] = 0.0
    basis[0] /= _norm(basis[0])
    for k in range(out.shape[1]):
        new = basis[k + 1]
        _over_period(steps, shape, direction, basis[k], new)
        for _ in range(2):
            for j in range(k + 1):
                overlap = 0.0
                for i in range(new.size):
                    overlap += basis[j, i] * new[i]
                out[j, k] += overlap
                for i in range(new.size):
                    new[i] -= overlap * basis[j, i]
        norm = _norm(new)
        out[k + 1, k] = norm
        if norm == 0.0:
            break
        new /= norm
