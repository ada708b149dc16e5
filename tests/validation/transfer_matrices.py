"""Spindles by 50-digit transfer matrices, a reference that shares nothing with the model.

Source: E. C. Pestel and F. A. Leckie, Matrix Methods in Elastomechanics, 1963; the state is (u, t, Q, M) with
EI t' = M, kappa G A (u' - t) = Q, Q' = -m w^2 u, M' = -Q - rho I w^2 t.
"""

from __future__ import annotations

import math

import mpmath
from mpmath import mpf

from dsm import Segment, Spindle

DIGITS = 50


def determinant(spindle: Spindle, frequency: float) -> mpf:
    """0 at a natural frequency (Hz) of the shaft with free ends."""
    with mpmath.workdps(DIGITS):
        end, _ = _along(spindle, frequency, math.inf)
        return end[2, 0] * end[3, 1] - end[2, 1] * end[3, 0]


def exact_receptance(spindle: Spindle, frequency: float, position: float) -> mpf:
    """Driving-point receptance (m/N) at a frequency (Hz) and a place (m), undamped."""
    with mpmath.workdps(DIGITS):
        end, before = _along(spindle, frequency, position)
        beyond = end * before**-1
        ends = mpmath.matrix([[end[2, 0], end[2, 1]], [end[3, 0], end[3, 1]]])
        tip = mpmath.lu_solve(ends, mpmath.matrix([beyond[2, 2], beyond[3, 2]]))
        return before[0, 0] * tip[0] + before[0, 1] * tip[1]


def _along(spindle: Spindle, frequency: float, position: float) -> tuple[mpmath.matrix, mpmath.matrix]:
    """Transfer matrices from the tip to the far end, and to a place."""
    w2 = (2 * mpmath.pi * mpf(frequency)) ** 2
    ends = [mpf(0)]
    for segment in spindle.segments:
        ends.append(ends[-1] + mpf(segment.length))
    places = {
        *ends,
        *(mpf(part.position) for part in spindle.bearings),
        *(mpf(mass.position) for mass in spindle.masses),
    }
    places |= {mpf(joint.position) for joint in spindle.joints} | ({mpf(position)} - {mpf("inf")})
    stops = sorted(places)
    total = before = mpmath.eye(4)
    for place, following in zip(stops, [*stops[1:], None], strict=True):
        total = _parts(spindle, place, w2) * total
        before = total if place == position else before
        if following is not None:
            index = max(i for i, end in enumerate(ends[:-1]) if end <= place)
            total = _uniform(spindle, spindle.segments[index], following - place, w2) * total
    return total, before


def _parts(spindle: Spindle, place: mpf, w2: mpf) -> mpmath.matrix:
    """What bearings, masses and joints at one place do; none of them meet there."""
    matrix = mpmath.eye(4)
    for bearing in spindle.bearings:
        if bearing.position == place:
            matrix[2, 0] += 1 / (1 / mpf(bearing.stiffness) + 1 / mpf(bearing.housing_stiffness))
            matrix[3, 1] += mpf(bearing.rotational_stiffness)
    for mass in spindle.masses:
        if mass.position == place:
            matrix[2, 0] -= mpf(mass.mass) * w2
            matrix[3, 1] -= mpf(mass.diametral_inertia) * w2
    for joint in spindle.joints:
        if joint.position == place:
            matrix[0, 2], matrix[1, 3] = 1 / mpf(joint.stiffness), 1 / mpf(joint.rotational_stiffness)
    return matrix


def _uniform(spindle: Spindle, segment: Segment, length: mpf, w2: mpf) -> mpmath.matrix:
    """exp(A L) as a power series, rows and columns scaled to one size."""
    material = segment.material or spindle.material
    outer, bore = mpf(segment.outer_diameter), mpf(segment.bore_diameter)
    area, second = mpmath.pi * (outer**2 - bore**2) / 4, mpmath.pi * (outer**4 - bore**4) / 64
    rigidity, density = mpf(material.youngs_modulus) * second, mpf(material.density)
    soft, turning = mpf(0), mpf(0)
    if spindle.theory == "timoshenko":
        nu, ring = mpf(material.youngs_modulus) / (2 * mpf(material.shear_modulus)) - 1, (1 + (bore / outer) ** 2) ** 2
        kappa = 6 * (1 + nu) * ring / ((7 + 6 * nu) * ring + (20 + 12 * nu) * (bore / outer) ** 2)
        soft, turning = 1 / (kappa * mpf(material.shear_modulus) * area), density * second * w2
    rows = [[0, 1, soft, 0], [0, 0, 0, 1 / rigidity], [-density * area * w2, 0, 0, 0], [0, -turning, -1, 0]]
    size = [mpf(1), 1 / length, rigidity / length**3, rigidity / length**2]
    slope = mpmath.matrix(4, 4)
    for i in range(4):
        for j in range(4):
            slope[i, j] = rows[i][j] * length * size[j] / size[i]
    found = term = mpmath.eye(4)
    for order in range(1, 300):
        term = term * slope / order
        found = found + term
        if max(abs(value) for value in term) < mpf(10) ** (-DIGITS - 2):
            break
    for i in range(4):
        for j in range(4):
            found[i, j] *= size[i] / size[j]
    return found
