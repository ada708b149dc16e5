"""The paper's spinning element A B^-1, equations (13) to (25), compared with the pole-free one."""

import math
from itertools import pairwise

import numpy as np

from dsm import Spindle, SpinningSegment, spinning_element
from dsm.arrays import Floats
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup


def printed_element(
    segment: SpinningSegment, frequency: float, speed_rpm: float, coupling: float = 1.0, one_sign: bool = True
) -> Floats:
    """Return the stiffness of one element at a frequency (Hz) seen from the shaft, (8, 8), as `spinning_element`.

    The eight solutions exp(r z) of (13), r by (14) to (16), each with its ratio of v to u: their end forces are A,
    their end displacements B. coupling: sign of 2 m Omega w in (5), + as printed, - for u = U cos, v = V sin.
    one_sign: end forces have one sign at both ends, as (23) is printed; the opposite one at z = 0 is right. Not finite
    if B cannot be inverted: at speed 0, at frequency 0, and if the two are equal.
    """
    length, exx, eyy = segment.length, segment.rigidity_xx, segment.rigidity_yy
    same, other = _inertia_forces(segment, frequency, speed_rpm)
    q = fourth_powers(segment, frequency, speed_rpm)
    with np.errstate(all="ignore"):
        root = np.repeat(q + 0j, 4) ** 0.25 * np.tile(1j ** np.arange(4), 2)
        shape = np.array([np.ones(8), -(eyy * np.repeat(q, 4) - same) / (other * coupling)])
        displaced, forced = [], []
        for end, outward in ((0.0, 1.0 if one_sign else -1.0), (length, 1.0)):
            wave = shape * np.exp(root * end)
            displaced += [wave, root * wave]
            rigid = np.array([[eyy], [exx]])
            forced += [-outward * rigid * root**3 * wave, outward * rigid * root**2 * wave]
        try:
            return np.asarray(np.real(np.vstack(forced) @ np.linalg.inv(np.vstack(displaced))))
        except np.linalg.LinAlgError:
            return np.full((8, 8), np.nan)


def _inertia_forces(segment: SpinningSegment, frequency: float, speed_rpm: float) -> tuple[float, float]:
    """Return m (w^2 + Omega^2) and 2 m w Omega, of one length and deflection (N/m^2)."""
    w, spin = 2 * np.pi * frequency, speed_rpm * np.pi / 30
    return segment.mass_per_length * (w**2 + spin**2), 2 * segment.mass_per_length * w * spin


def fourth_powers(segment: SpinningSegment, frequency: float, speed_rpm: float) -> Floats:
    """Return the two fourth powers of the roots of (13) by (14) to (16) (m^-4), shape (2,)."""
    exx, eyy = segment.rigidity_xx, segment.rigidity_yy
    same, other = _inertia_forces(segment, frequency, speed_rpm)
    mean = same * (exx + eyy) / 2
    half = np.sqrt(max(mean**2 - exx * eyy * (same**2 - other**2), 0.0))  # not negative but for rounding
    return np.array([mean + half, mean - half]) / (exx * eyy)


ELEMENT_SPEED_RPM = 24000.0
"""Speed at which the segments of the surrogate are compared (rpm)."""
UNEQUAL_BEAM = SpinningSegment(length=0.5, rigidity_xx=1.0, rigidity_yy=4.0, mass_per_length=1.0)
"""Half of a beam of length 1 that is not round, which shows the signs."""
UNEQUAL_BEAM_SPEED_RPM = 30 / math.pi
"""Speed of that beam (rpm), 1 rad/s."""
ROOT_SCAN_FREQUENCIES = np.linspace(0.05, 40.0, 1600)
"""Frequencies at which sign changes of its determinant are searched (rad/s)."""


def element_section(spindle: Spindle) -> NumberGroup:
    """Return the numbers of the element: of the segments of a round shaft, and of a cantilever that is not round."""
    frequency, modulus, density = printed.FREQUENCY, spindle.youngs_modulus, spindle.density
    sizes = ((segment.length, modulus * segment.second_moment, density * segment.area) for segment in spindle.segments)
    segments = [SpinningSegment(length, rigidity, rigidity, mass) for length, rigidity, mass in sizes]
    root_error = max(_root_error(segment) for segment in segments)
    speeds = ELEMENT_SPEED_RPM, 60 * frequency * (1 + 1e-6)
    error, critical_error = (max(_element_error(segment, frequency, speed) for segment in segments) for speed in speeds)
    singular = (printed_element(segments[0], frequency, speed) for speed in (0.0, 60 * frequency))
    at_rest, at_speed = ("exists" if np.all(np.isfinite(k)) else "does not exist" for k in singular)
    as_printed = printed_element(UNEQUAL_BEAM, 0.3, UNEQUAL_BEAM_SPEED_RPM)
    asymmetry = float(np.max(np.abs(as_printed - as_printed.T)) / np.max(np.abs(as_printed)))
    right, other, wrong = _cantilever_roots(-1.0, False), _cantilever_roots(1.0, False), _cantilever_roots(-1.0, True)
    solver = "compared with an eigenvalue solver, 26 segments at 1722 Hz: correct as printed"
    rpm = ELEMENT_SPEED_RPM
    rounding = f"signs corrected, 26 segments, {rpm:.0f} rpm: rounding. At speed 0 A B^-1 {at_rest}, our element does."
    near = f"speed 1e-6 off 1722 Hz. At exactly 1722 Hz A B^-1 {at_speed}, our element does."
    shapes = f"cantilever with unequal axes: {right[0]:.5f} with the correct sign, which changes the shapes only"
    symmetric = (
        "largest entry: end forces printed with one sign. With the correct signs the stiffness matrix is symmetric."
    )
    highest = f"{ROOT_SCAN_FREQUENCIES[-1]:.0f} rad/s"
    none = (
        f"number of natural frequencies of the cantilever below {highest}, assembled as printed. Correct: {len(right)}."
    )
    numbers = (
        Comparison("error of the roots", "(14)-(16)", None, root_error, "-", 1, solver),
        Comparison("error of A B^-1", "(17)-(25)", None, error, "-", 1, rounding),
        Comparison("error of A B^-1 near w = Omega", "(17)-(25)", None, critical_error, "-", 1, near),
        Comparison("first root with the sign of (5)", "(5)", None, other[0], "rad/s", 6, shapes),
        Comparison("K minus its transpose", "(23)", None, asymmetry, "-", 2, symmetric),
        Comparison("roots with the signs of (23)", "(23)", None, len(wrong), "", 1, none),
    )
    return NumberGroup("The spinning element: eqs. (5) and (13) to (25)", (), numbers)


def _element_error(segment: SpinningSegment, frequency: float, speed_rpm: float) -> float:
    """Return the largest error over the largest entry, moments and slopes scaled by the length."""
    sections = segment.rigidity_xx, segment.rigidity_yy, segment.mass_per_length, segment.length
    exact = spinning_element(*sections, [frequency], speed_rpm)[0]
    scale = np.tile([1.0, 1.0, segment.length, segment.length], 2)
    error = printed_element(segment, frequency, speed_rpm, coupling=-1.0, one_sign=False) - exact
    return float(np.max(np.abs(error) / np.outer(scale, scale)) / np.max(np.abs(exact) / np.outer(scale, scale)))


def _root_error(segment: SpinningSegment) -> float:
    same, other = _inertia_forces(segment, printed.FREQUENCY, ELEMENT_SPEED_RPM)
    xx, yy = segment.rigidity_xx, segment.rigidity_yy
    pencil = np.array([[same / yy, other / yy], [other / xx, same / xx]])
    exact = np.sort(np.linalg.eigvals(pencil).real)[::-1]
    return float(np.max(np.abs(fourth_powers(segment, printed.FREQUENCY, ELEMENT_SPEED_RPM) / exact - 1)))


def _cantilever_roots(coupling: float, one_sign: bool) -> list[float]:
    """Return frequencies (rad/s) of the cantilever of two elements at sign changes of its determinant."""
    from scipy.optimize import brentq  # takes longer to import than what it solves

    def determinant(w: float) -> float:
        element = printed_element(UNEQUAL_BEAM, w / (2 * np.pi), UNEQUAL_BEAM_SPEED_RPM, coupling, one_sign)
        whole = np.zeros((12, 12))
        whole[:8, :8] += element
        whole[4:, 4:] += element
        sign, size = np.linalg.slogdet(whole[4:, 4:])
        return float(sign * np.exp(size / 8))

    points = pairwise((w, determinant(w)) for w in ROOT_SCAN_FREQUENCIES)
    return [float(brentq(determinant, a, b, xtol=1e-12)) for (a, x), (b, y) in points if x * y < 0]
