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

REACH = 1.5
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
                _normalise(basis[1], basis[0])
            _arnoldi(steps, shape, direction, basis, out[i, j])


@njit(cache=True, nogil=True)
def _normalise(vector, out):
    """Fill out with the vector at length 1 and return its length; out stays where that is 0."""
    total = 0.0
    for value in vector:
        total += value * value
    length = np.sqrt(total)
    if length > 0.0:
        out[:] = vector / length
    return length


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
    """Fill steps[k]."""
    n, p = shape.size, forces.shape[1]
    push = gain * shape[0] * forces[k, 0, 0]
    if n == 1 and abs(stiffness[0] + push * shape[0]) + damping[0] ** 2 < REACH * REACH:
        _one_mode_interval(damping[0], stiffness[0], push, push * shape[0], steps[k])
        return
    h, halvings = _stiffen(damping, stiffness, shape, direction, forces, gain, k, work)
    _impulse(damping, work, h)
    _fill(damping, shape, direction, forces, gain, work, k, steps)
    for _ in range(halvings):
        _double(steps[k], n, p, h)
        h *= 2
    for r in range(p):
        for a in range(2 * n):
            steps[k, 2 * n + r, a] -= steps[k, 2 * n + p + r, a]


@njit(cache=True, nogil=True)
def _fill(damping, shape, direction, forces, gain, work, k, steps):
    """Fill steps[k] from the response of the modes to an impulse on each: its value g, g', and its integrals.

    Work (8, n, n) holds, from the third on, the stiffness with the cut, g, g', the integral of g and that of it. The
    response to an initial q is g' + g damping, to a force that begins and stays the integral of g, to one that rises
    evenly the integral of that.
    """
    n, p = shape.size, forces.shape[1]
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


@njit(cache=True, nogil=True)
def _one_mode_interval(damping, stiffness, push, pull, step):
    """Fill step with the map of one mode that turns by less than REACH, without loops inside: five times as fast."""
    before, term = 0.0, 1.0
    g, rate, once, twice = 1.0, 1.0, 0.5, 1.0 / 6.0
    k = 0
    while abs(term) > ROUNDING or abs(before) > ROUNDING:
        new = -(damping * (k + 1) * term + (stiffness + pull) * before) / ((k + 1) * (k + 2))
        before, term = term, new
        g += new
        rate += (k + 2) * new
        once += new / (k + 3)
        twice += new / ((k + 3) * (k + 4))
        k += 1
    step[0, 0], step[0, 1] = rate + g * damping, -(stiffness + pull) * g
    step[1, 0], step[1, 1] = g, rate
    step[2, 0], step[2, 1] = push * (once - twice), push * (g - once)
    step[3, 0], step[3, 1] = push * twice, push * once


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
        slow, back = h / (k + 2), h * h / ((k + 1) * (k + 2))
        _multiply(work, 2, 0, 7)
        for a in range(n):
            for b in range(n):
                work[7, a, b] = -slow * damping[a] * work[1, a, b] - back * work[7, a, b]
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
    rate, once, twice = (k + 2) / h, h / (k + 3), h * h / ((k + 3) * (k + 4))
    for a in range(n):
        for b in range(n):
            new = work[7, a, b]
            work[0, a, b], work[1, a, b] = work[1, a, b], new
            work[3, a, b] += new
            work[4, a, b] += rate * new
            work[5, a, b] += once * new
            work[6, a, b] += twice * new
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
    if columns == 4:
        _one_mode_over_period(steps, shape, state, out)
        return
    n, p = rows // 2, (columns - rows) // 2
    known, after = np.empty(columns), np.empty(rows)
    known[:rows] = state[:rows]
    out[rows:] = 0.0
    for i in range(m):
        for a in range(n):
            out[rows + i * p + direction[a]] += shape[a] * known[a]
        for c in range(p):
            known[rows + c] = state[rows + i * p + c]
            known[rows + p + c] = state[rows + (i + 1) * p + c] if i < m - 1 else out[rows + c]
        step = steps[i]
        after[:] = 0.0
        for c in range(columns):
            value = known[c]
            for r in range(rows):
                after[r] += step[c, r] * value
        known[:rows] = after
    out[:rows] = after


@njit(cache=True, nogil=True)
def _one_mode_over_period(steps, shape, state, out):
    """The same for one mode in one direction, without loops inside: four times as fast."""
    m = steps.shape[0]
    q, v, lead = state[0], state[1], shape[0]
    was = state[2]
    first = lead * q
    out[2] = first
    for i in range(m):
        step = steps[i]
        after = state[3 + i] if i < m - 1 else first
        q, v = (
            step[0, 0] * q + step[1, 0] * v + step[2, 0] * was + step[3, 0] * after,
            step[0, 1] * q + step[1, 1] * v + step[2, 1] * was + step[3, 1] * after,
        )
        was = after
        if i < m - 1:
            out[3 + i] = lead * q
    out[0], out[1] = q, v


@njit(cache=True, nogil=True)
def _arnoldi(steps, shape, direction, basis, out):
    """Fill out (k + 1, k) with the Hessenberg matrix from the first row of basis (k + 1, states)."""
    out[:] = 0.0
    _normalise(basis[0], basis[0])
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
        out[k + 1, k] = _normalise(new, new)
        if out[k + 1, k] == 0.0:
            break
