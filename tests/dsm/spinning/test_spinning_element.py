"""The spinning bending-bending element against the closed form of the paper in high-precision arithmetic.

O. Gaber and S. M. Hashemi, Effects of machine tool spindle decay on the stability lobe diagram: an
analytical-experimental study, Shock and Vibration, 2015, eqs. (1)-(27), with the signs put right (docs/paper.md).
"""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from dsm.elements.element_series import element_series
from dsm.spinning.beam import spinning_element

RIGIDITY_XX, RIGIDITY_YY, MASS, LENGTH = 1.3, 4.1, 0.7, 0.9
BEAM = (RIGIDITY_XX, RIGIDITY_YY, MASS, LENGTH)


def literal(frequency: float, speed_rpm: float, digits: int = 60, detune: str = "0") -> NDArray[np.float64]:
    """Return A B^-1: end forces (A) and end displacements (B) of the eight solutions exp(r z) of the coupled equations.

    `detune` is added to the speed, as a share of it, where the literal form does not exist.
    """
    with mpmath.workdps(digits):
        exx, eyy, mass, length = (mpmath.mpf(value) for value in BEAM)
        w = 2 * mpmath.pi * mpmath.mpf(frequency)
        spin = mpmath.mpf(speed_rpm) * mpmath.pi / 30 * (1 + mpmath.mpf(detune))
        same, other = mass * (w**2 + spin**2), 2 * mass * w * spin
        mean, product = same * (exx + eyy) / 2, exx * eyy * (same**2 - other**2)
        half = mpmath.sqrt(mean**2 - product)
        forces, motions = mpmath.matrix(8, 8), mpmath.matrix(8, 8)
        for column in range(8):
            q = (mean + (half if column < 4 else -half)) / (exx * eyy)
            r = mpmath.root(q, 4) * mpmath.mpc(0, 1) ** (column % 4)
            shape = (1, (eyy * q - same) / other)
            for axis, rigidity in enumerate((eyy, exx)):
                for end, outward in ((0, -1), (1, 1)):
                    wave = shape[axis] * mpmath.exp(r * length * end)
                    motions[4 * end + axis, column] = wave
                    motions[4 * end + 2 + axis, column] = r * wave
                    forces[4 * end + axis, column] = -outward * rigidity * r**3 * wave
                    forces[4 * end + 2 + axis, column] = outward * rigidity * r**2 * wave
        matrix = forces * motions**-1
        assert max(abs(mpmath.im(value)) for value in matrix) < mpmath.mpf(10) ** (-digits // 4)
        return np.array([[float(mpmath.re(matrix[i, j])) for j in range(8)] for i in range(8)])


def planar(rigidity: float, w: float) -> NDArray[np.float64]:
    """Return the element of a beam at rest, of one part."""
    terms = element_series(np.array([rigidity]), np.array([MASS]), np.array([LENGTH]))[:, 0]
    a, b, c, d, e, f = terms @ (w**2) ** np.arange(terms.shape[1])
    return np.array([[a, b, d, e], [b, c, -e, f], [d, -e, a, -b], [e, f, -b, c]])


def close(found: NDArray[np.float64], exact: NDArray[np.float64], rel: float) -> bool:
    """Equal to a share of the largest entry of the same kind (forces, moments)."""
    scale = np.tile([1.0, 1.0, LENGTH, LENGTH], 2)
    error = np.abs(found - exact) / np.outer(scale, scale)
    return bool(np.max(error) <= rel * np.max(np.abs(exact) / np.outer(scale, scale)))


@pytest.mark.parametrize("speed_rpm", [0.3, 11.0, 60.0, 400.0])
@pytest.mark.parametrize("frequency", [0.05, 0.4, 1.1])
def test_equals_the_papers_form(frequency: float, speed_rpm: float) -> None:
    found = spinning_element(*BEAM, [frequency], speed_rpm)[0]
    assert close(found, literal(frequency, speed_rpm), 2e-14)


@pytest.mark.parametrize(("frequency", "speed_rpm"), [(9.0, 30.0), (30.0, 1000.0), (200.0, 50.0), (0.3, 9000.0)])
def test_long_elements_equal_the_papers_form(frequency: float, speed_rpm: float) -> None:
    found = spinning_element(*BEAM, [frequency], speed_rpm)[0]
    assert close(found, literal(frequency, speed_rpm, digits=80), 1e-12)


@pytest.mark.parametrize("frequency", [0.1, 2.0])
def test_right_where_speed_equals_frequency(frequency: float) -> None:
    found = spinning_element(*BEAM, [frequency], 60 * frequency)[0]
    assert np.all(np.isfinite(found))
    assert close(found, literal(frequency, 60 * frequency, 300, "1e-100"), 2e-14)


def test_right_at_vanishing_frequencies() -> None:
    """At frequency 0 the planes are two beams under the centrifugal load m W^2 d: planar elements with w = W."""
    near, at = spinning_element(*BEAM, [1e-9, 0.0], 33.0)
    assert close(near, literal(1e-9, 33.0, 300), 2e-14)
    spin = 33.0 * math.pi / 30
    assert at[::2, ::2] == pytest.approx(planar(RIGIDITY_YY, spin), rel=1e-13)
    assert at[1::2, 1::2] == pytest.approx(planar(RIGIDITY_XX, spin), rel=1e-13)
    assert not np.any(at[::2, 1::2])


def test_two_planar_elements_at_speed_0() -> None:
    frequency = np.array([0.0, 1e-6, 0.2, 0.6])
    for w, found in zip(2 * math.pi * frequency, spinning_element(*BEAM, frequency, 0.0), strict=True):
        assert found[::2, ::2] == pytest.approx(planar(RIGIDITY_YY, w), rel=1e-13)
        assert found[1::2, 1::2] == pytest.approx(planar(RIGIDITY_XX, w), rel=1e-13)
        assert not np.any(found[::2, 1::2])


def test_a_round_element_is_two_planar_ones_at_the_sum_and_the_difference() -> None:
    found = spinning_element(RIGIDITY_XX, RIGIDITY_XX, MASS, LENGTH, [0.3], 9.0)[0]
    w, spin = 0.6 * math.pi, 0.3 * math.pi
    forward, backward = planar(RIGIDITY_XX, w + spin), planar(RIGIDITY_XX, w - spin)
    assert found[::2, ::2] == pytest.approx((forward + backward) / 2, rel=1e-13)
    assert found[::2, 1::2] == pytest.approx((forward - backward) / 2, rel=1e-12)


def test_symmetric_and_each_frequency_by_itself() -> None:
    frequency = np.array([0.0, 0.5, 3.0, 700.0])
    together = spinning_element(*BEAM, frequency, 20.0)
    assert np.array_equal(together, together.swapaxes(1, 2))
    assert np.array_equal(together, np.concatenate([spinning_element(*BEAM, [f], 20.0) for f in frequency]))


@pytest.mark.quick
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("rigidity_xx", {"rigidity_xx": 0.0}),
        ("rigidity_yy", {"rigidity_yy": math.nan}),
        ("mass_per_length", {"mass_per_length": -1.0}),
        ("length", {"length": math.inf}),
        ("frequency", {"frequency": [1.0, -1.0]}),
        ("frequency", {"frequency": [math.nan]}),
        ("speed_rpm", {"speed_rpm": -1.0}),
    ],
)
def test_rejects(name: str, change: dict[str, float]) -> None:
    good = {"rigidity_xx": 1, "rigidity_yy": 1, "mass_per_length": 1, "length": 1, "frequency": [1.0], "speed_rpm": 0}
    with pytest.raises(ValueError, match=name):
        spinning_element(**{**good, **change})  # type: ignore[arg-type]
