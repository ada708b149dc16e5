"""Beam elements of a shaft as power series, by stiffness or, where they are very short, by flexibility."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.elements import matrix_series
from dsm.elements.element_series import TERMS, element_series
from dsm.elements.transfer_series import transfer_series
from dsm.elements.whirl_terms import number_of_terms
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Theory

_Float = NDArray[np.float64]
_Indices = NDArray[np.int_]


def stiffness_elements(
    shaft: Sections, theory: Theory, segment: _Indices, start: _Float, end: _Float, apart: bool = False
) -> _Float:
    """Dynamic stiffness of elements as series, shape (10, n, n_terms); arguments as for transfer_series.

    With u, t of both ends the rows are k(u1,u1), k(u1,t1), k(t1,t1); k(u2,u2), k(u2,t2), k(t2,t2); k(u1,u2), k(u1,t2),
    k(t1,u2), k(t1,t2).
    """
    stiffness = np.zeros((10, segment.size, number_of_terms(apart)))
    plain = ~shaft.is_cone[segment] & (theory == "euler-bernoulli")
    if np.any(plain):
        section = shaft.at(segment[plain], start[plain])
        series = element_series(section.rigidity, section.mass, (end - start)[plain])
        mirror = np.array([1, -1, 1])[:, np.newaxis, np.newaxis]
        rows = np.concatenate([series[:3], mirror * series[:3], series[3:5], -series[4:5], series[5:]])
        stiffness[:, plain, :: TERMS if apart else 1] = rows
    if not np.all(plain):
        rest = ~plain
        transfer = transfer_series(shaft, theory, segment[rest], start[rest], end[rest], apart)
        stiffness[:, rest] = _by_stiffness(transfer)
    return stiffness


def link_elements(
    shaft: Sections, theory: Theory, segment: _Indices, start: _Float, end: _Float, apart: bool = False
) -> _Float:
    """Short elements as series that lose nothing however short they are, shape (10, n, n_terms); arguments as above.

    Unknown beside q1 = (u1, t1) are the force and the moment p at end 2: [f1; 0; f2] = [[S, -H^T, 0], [-H, -F, I],
    [0, I, 0]] [q1; p; q2], so that q2 = H q1 + F p: a rigid lever H, the flexibility F in series, the inertia in S. The
    rows are S(u,u), S(u,t), S(t,t); -F(Q,Q), -F(Q,M), -F(M,M); -H^T(u,Q), -H^T(u,M), -H^T(t,Q), -H^T(t,M).
    """
    if segment.size == 0:
        return np.zeros((10, 0, number_of_terms(apart)))
    transfer = transfer_series(shaft, theory, segment, start, end, apart)
    _, b, c, d = _quarters(transfer)
    lever = matrix_series.inverse(d)  # H^T
    flexibility = matrix_series.product(b, lever)
    inertia = matrix_series.product(lever, c)
    return np.stack([*_triangle(inertia), *_triangle(-flexibility), *_entries(-lever)])


def _by_stiffness(transfer: _Float) -> _Float:
    """Of f1 = -(Q1, M1) and f2 = (Q2, M2) with q2 = A q1 + B (Q1, M1): K11 = B^-1 A, K12 = -B^-1, K22 = D B^-1."""
    a, b, _, d = _quarters(transfer)
    across = matrix_series.inverse(b)
    near, far = matrix_series.product(across, a), matrix_series.product(d, across)
    return np.stack([*_triangle(near), *_triangle(far), *_entries(-across)])


def _quarters(transfer: _Float) -> tuple[_Float, _Float, _Float, _Float]:
    return transfer[:, :2, :2], transfer[:, :2, 2:], transfer[:, 2:, :2], transfer[:, 2:, 2:]


def _entries(matrix: _Float) -> tuple[_Float, _Float, _Float, _Float]:
    return matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]


def _triangle(matrix: _Float) -> tuple[_Float, _Float, _Float]:
    """The upper half of a symmetric matrix, the mean of the two halves."""
    return matrix[:, 0, 0], (matrix[:, 0, 1] + matrix[:, 1, 0]) / 2, matrix[:, 1, 1]
