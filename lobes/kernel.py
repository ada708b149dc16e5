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

from __future__ import annotations

import numpy as np
from numba import njit

REACH = 1.0
"""Largest angle (rad) of one Taylor series; beyond, the interval is halved and its map squared."""
ROUNDING = 1e-17
"""A Taylor series ends with two terms below this."""


@njit(cache=True, nogil=True)
def hessenberg(damping, stiffness, shape, direction, force, which, gain, start, warm_up, out):
    """Fill out (s, d, k + 1, k) with the Hessenberg matrices of k Arnoldi steps after `warm_up` power steps.

    damping, stiffness (s, n); shape, direction (n,); case (s, d) has the forces gain[s, d] force[which[s, d]] of
    force (c, m, p, p); start: a state.
    """
    n, (_, m, p, _) = shape.size, force.shape
    steps = np.empty((m, 2 * n + 2 * p, 2 * n))
    basis = np.empty((out.shape[2], start.size))
    work = np.empty((8, n, n))
    for i in range(gain.shape[0]):
        for j in range(gain.shape[1]):
            one = force[which[i, j]]
            for k in range(m):
                if _same(one, k):
                    steps[k] = steps[k - 1]
                else:
                    _interval(damping[i], stiffness[i], shape, direction, one, gain[i, j], work, k, steps)
            basis[0] = start
            for _ in range(warm_up):
                _over_period(steps, shape, direction, basis[0], basis[1])
                basis[0] = basis[1] / _norm(basis[1])
            _arnoldi(steps, shape, direction, basis, out[i, j])


@njit(cache=True, nogil=True)
def _norm(vector):
    total = 0.0
    for value in vector:
        total += value * value
    return np.sqrt(total)


@njit(cache=True, nogil=True)
def _same(forces, k):
    """Whether interval k has the forces of the one before."""
    if k == 0:
        return False
    for a in range(forces.shape[1]):
        for b in range(forces.shape[2]):
            if forces[k, a, b] != forces[k - 1, a, b]:
                return False
    return True


@njit(cache=True, nogil=True)
def _interval(damping, stiffness, shape, direction, forces, gain, work, k, steps):
    """Fill steps[k] from the response of the modes to an impulse on each: its value g, g', and its integrals.

    Work (8, n, n) holds, from the third on, the stiffness with the cut, g, g', the integral of g and that of it. The
    response to an initial q is g' + g damping, to a force that begins and stays the integral of g, to one that rises
    evenly the integral of that.
    """
    n, p = shape.size, forces.shape[1]
    h, halvings = _stiffen(damping, stiffness, shape, direction, forces, gain, k, work)
    _impulse(damping, work, h)
    _multiply(work, 2, 3, 7)
    for a in range(n):
        for b in range(n):
            steps[k, b, a] = work[4, a, b] + work[3, a, b] * damping[b]
            steps[k, b, n + a] = -work[7, a, b] - damping[a] * work[4, a, b] + work[4, a, b] * damping[b]
            steps[k, n + b, a] = work[3, a, b]
            steps[k, n + b, n + a] = work[4, a, b]
        for r in range(p):
            value, integral, twice = 0.0, 0.0, 0.0
            for b in range(n):
                push = gain * shape[b] * forces[k, direction[b], r]
                value, integral = value + work[3, a, b] * push, integral + work[5, a, b] * push
                twice += work[6, a, b] * push
            steps[k, 2 * n + r, a], steps[k, 2 * n + r, n + a] = integral, value
            steps[k, 2 * n + p + r, a], steps[k, 2 * n + p + r, n + a] = twice, integral
    for _ in range(halvings):
        _double(steps[k], n, p, h)
        h *= 2
    for r in range(p):
        for a in range(2 * n):
            steps[k, 2 * n + r, a] -= steps[k, 2 * n + p + r, a]


@njit(cache=True, nogil=True)
def _stiffen(damping, stiffness, shape, direction, forces, gain, k, work):
    """Fill work[2] with the stiffness of modes and cut; return the time of one series and how often to double it."""
    n = shape.size
    largest = 0.0
    for a in range(n):
        row = damping[a] ** 2
        for b in range(n):
            work[2, a, b] = gain * shape[a] * forces[k, direction[a], direction[b]] * shape[b]
            if a == b:
                work[2, a, b] += stiffness[a]
            row += abs(work[2, a, b])
        largest = max(largest, row)
    h, halvings = 1.0, 0
    while largest * h * h > REACH * REACH:
        h, halvings = h / 2, halvings + 1
    return h, halvings


@njit(cache=True, nogil=True)
def _impulse(damping, work, h):
    """Fill work[3:7] with g, g', the integral of g and the integral of that at time h, by the Taylor series of g."""
    n = damping.size
    for a in range(n):
        for b in range(n):
            one = h if a == b else 0.0
            work[0, a, b], work[1, a, b] = 0.0, one
            work[3, a, b], work[4, a, b], work[5, a, b], work[6, a, b] = one, one / h, one * h / 2, one * h * h / 6
    k, largest = 0, 1.0
    while largest > ROUNDING:
        share = 1.0 / ((k + 1) * (k + 2))
        _multiply(work, 2, 0, 7)
        for a in range(n):
            for b in range(n):
                work[7, a, b] = -(damping[a] * h * (k + 1) * work[1, a, b] + h * h * work[7, a, b]) * share
        largest = _add_term(work, k, h)
        k += 1


@njit(cache=True, nogil=True)
def _multiply(work, one, other, to):
    """work[to] = work[one] @ work[other]."""
    n = work.shape[1]
    for a in range(n):
        for b in range(n):
            total = 0.0
            for c in range(n):
                total += work[one, a, c] * work[other, c, b]
            work[to, a, b] = total


@njit(cache=True, nogil=True)
def _add_term(work, k, h):
    """Add the term h^(k + 2) in work[7] to g and its kin; return the largest of the last two terms."""
    largest, n = 0.0, work.shape[1]
    for a in range(n):
        for b in range(n):
            new = work[7, a, b]
            work[0, a, b], work[1, a, b] = work[1, a, b], new
            work[3, a, b] += new
            work[4, a, b] += (k + 2) * new / h
            work[5, a, b] += h * new / (k + 3)
            work[6, a, b] += h * h * new / ((k + 3) * (k + 4))
            largest = max(largest, abs(new), abs(work[0, a, b]))
    return largest


@njit(cache=True, nogil=True)
def _double(step, n, p, h):
    """Turn the transposed map over time h (from z, w and the slope of w) into the one over 2h."""
    first = step.copy()
    for c in range(2 * n + 2 * p):
        for r in range(2 * n):
            total = 0.0
            for k in range(2 * n):
                total += first[c, k] * first[k, r]
            if c >= 2 * n:
                total += first[c, r]
            if c >= 2 * n + p:
                total += h * first[c - p, r]
            step[c, r] = total


@njit(cache=True, nogil=True)
def _over_period(steps, shape, direction, state, out):
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
        _add_columns(steps, i, 0, z, 0, rows, after)
        _add_columns(steps, i, rows, state, begin, p, after)
        if i < m - 1:
            _add_columns(steps, i, rows + p, state, begin + p, p, after)
        else:
            _add_columns(steps, i, rows + p, out, rows, p, after)
        z, after = after, z
        if i < m - 1:
            for a in range(n):
                out[begin + p + direction[a]] += shape[a] * z[a]
    out[:rows] = z


@njit(cache=True, nogil=True)
def _add_columns(steps, i, first, vector, begin, count, total):
    """Add the share of vector[begin : begin + count] in what comes out of interval i to total."""
    for c in range(count):
        value = vector[begin + c]
        for r in range(total.size):
            total[r] += steps[i, first + c, r] * value


@njit(cache=True, nogil=True)
def _arnoldi(steps, shape, direction, basis, out):
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
