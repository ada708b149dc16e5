"""Spinning beams against closed forms and independent finite elements.

Uniform with classical ends: with a, b the squares of two planar natural frequencies of one shape, the frequencies w
seen from the beam obey (a - W^2 - w^2)(b - W^2 - w^2) = 4 W^2 w^2. Planar roots: R. D. Blevins, Formulas for Natural
Frequency and Mode Shape, table 8-1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsm.spinning.beam import SpinningBeam, SpinningDof, SpinningSegment, SpinningSpring
from dsm.spinning.frequencies import UnstableSpinError, spinning_frequencies

CANTILEVER = [3.5160152685002, 22.034491564667, 61.697214413549, 120.90191605231]
CLAMPED: list[tuple[float, SpinningDof]] = [(0.0, "u"), (0.0, "v"), (0.0, "u'"), (0.0, "v'")]
PINNED: list[tuple[float, SpinningDof]] = [(0.0, "u"), (0.0, "v"), (1.0, "u"), (1.0, "v")]


def unit_beam(
    rigidity_yy: float,
    held: Sequence[tuple[float, SpinningDof]] = (),
    springs: Sequence[SpinningSpring] = (),
    pieces: int = 1,
) -> SpinningBeam:
    """EIxx = m = L = 1."""
    return SpinningBeam([SpinningSegment(1 / pieces, 1.0, rigidity_yy, 1.0)] * pieces, springs, held)


def angular(beam: SpinningBeam, count: int, spin: float) -> NDArray[np.float64]:
    """Natural frequencies in rad/s at a speed in rad/s."""
    return 2 * math.pi * spinning_frequencies(beam, count, spin * 30 / math.pi)


def with_growing(beam: SpinningBeam, count: int, spin: float) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """Return the steady frequencies, and the number of growing modes: all, and proved."""
    try:
        return angular(beam, count, spin), (0, 0)
    except UnstableSpinError as exc:
        return 2 * math.pi * exc.frequency, (exc.unstable, exc.proved)


def closed_form(planar: Sequence[float], rigidity_yy: float, spin: float) -> list[float]:
    """Return the stable frequencies for EIxx = 1 from the planar ones for EI = 1."""
    squares = []
    for a in np.array(planar) ** 2:
        b = rigidity_yy * a
        total, product = a + b + 2 * spin**2, (a - spin**2) * (b - spin**2)
        larger = (total + math.sqrt(total**2 - 4 * product)) / 2
        squares += [larger, product / larger]
    return sorted(math.sqrt(square) for square in squares if square > 0)


@pytest.mark.parametrize("pieces", [1, 3])
@pytest.mark.parametrize(
    ("spin", "expected"),
    [
        (1.0, [3.206941, 7.316239, 21.981653, 44.118035, 61.678310]),
        (2.0, [2.439570, 7.991265, 21.824421, 44.263854]),
        (3.0, [1.319889, 8.835707, 21.566467, 44.502602]),
        (3.4, [0.599557, 9.196323]),
    ],
)
def test_reference_numbers_of_a_cantilever(spin: float, expected: list[float], pieces: int) -> None:
    found = angular(unit_beam(4.0, CLAMPED, pieces=pieces), len(expected), spin)
    assert found == pytest.approx(expected, rel=0, abs=5.5e-7)


@pytest.mark.parametrize("spin", [0.0, 1.0, 3.4, 7.1, 15.0, 21.0, 44.5, 50.0])
def test_cantilever_closed_form_below_and_above_critical_speeds(spin: float) -> None:
    found = angular(unit_beam(4.0, CLAMPED), 5, spin)
    assert found == pytest.approx(closed_form(CANTILEVER, 4.0, spin)[:5], rel=2e-11, abs=5e-11)


@pytest.mark.parametrize("count", [1, 6])
@pytest.mark.parametrize("spin", [0.0, 5.0, 17.0, 35.0, 60.0])
def test_pinned_closed_form(spin: float, count: int) -> None:
    planar = [(n * math.pi) ** 2 for n in (1, 2, 3, 4, 5)]
    found = angular(unit_beam(2.0, PINNED), count, spin)
    assert found == pytest.approx(closed_form(planar, 2.0, spin)[:count], rel=2e-11)


@pytest.mark.parametrize("spin", [0.0, 12.0])
def test_one_mode_clamped_at_both_ends(spin: float) -> None:
    beam = unit_beam(1.2, [*CLAMPED, (1.0, "u"), (1.0, "v"), (1.0, "u'"), (1.0, "v'")])
    assert angular(beam, 1, spin) == pytest.approx(closed_form([22.373285448061], 1.2, spin)[:1], rel=2e-11)


@pytest.mark.parametrize(("spin", "growing"), [(3.6, 1), (7.0, 1), (30.0, 1), (100.0, 1)])
def test_modes_between_the_critical_speeds_of_the_planes_grow(spin: float, growing: int) -> None:
    with pytest.raises(UnstableSpinError, match=rf"^{growing} mode\(s\)") as caught:
        angular(unit_beam(4.0, CLAMPED), 4, spin)
    assert caught.value.unstable == caught.value.proved == growing
    expected = closed_form(CANTILEVER, 4.0, spin)[:4]
    assert 2 * math.pi * caught.value.frequency == pytest.approx(expected, rel=2e-11)


def test_two_modes_grow_where_the_planes_are_far_apart() -> None:
    with pytest.raises(UnstableSpinError) as caught:
        angular(unit_beam(400.0, CLAMPED), 3, 50.0)
    assert (caught.value.unstable, caught.value.proved) == (2, 2)
    expected = closed_form(CANTILEVER, 400.0, 50.0)[:3]
    assert 2 * math.pi * caught.value.frequency == pytest.approx(expected, rel=2e-11)


@pytest.mark.parametrize("spin", [CANTILEVER[0], 2 * CANTILEVER[0]])
def test_a_critical_speed_is_rejected(spin: float) -> None:
    with pytest.raises(ArithmeticError, match="critical speed"):
        angular(unit_beam(4.0, CLAMPED), 2, spin)


@pytest.mark.parametrize("critical", [CANTILEVER[0], 2 * CANTILEVER[0]])
@pytest.mark.parametrize("beside", [-1e-4, 1e-4])
def test_close_to_a_critical_speed(critical: float, beside: float) -> None:
    spin = critical * (1 + beside)
    found, (growing, proved) = with_growing(unit_beam(4.0, CLAMPED), 4, spin)
    assert growing == proved == ((beside > 0) == (critical == CANTILEVER[0]))
    assert found == pytest.approx(closed_form(CANTILEVER, 4.0, spin)[:4], rel=1e-8)


def test_modes_that_meet_with_opposite_energy_are_not_proved() -> None:
    """The first shape lowers the count where the second raises it: no step is seen."""

    def apart(spin: float) -> float:
        return closed_form([math.pi**2], 2.0, spin)[0] - closed_form([4 * math.pi**2], 2.0, spin)[0]

    spin = scipy.optimize.brentq(apart, 17.0, 35.0, xtol=1e-13)
    with pytest.raises(ArithmeticError, match="rounding"):
        angular(unit_beam(2.0, PINNED), 3, spin)
    assert len(angular(unit_beam(2.0, PINNED), 3, spin + 0.01)) == 3


@pytest.mark.parametrize("left_out", [1, 2])
def test_a_start_that_lacks_a_mode_is_not_believed(left_out: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def forgetful(left: object, right: object, subset_by_index: list[int]) -> object:
        first, last = subset_by_index
        ratio, vectors = scipy.linalg.eigh(left, right, subset_by_index=[first - 1, last])
        kept = np.delete(np.arange(ratio.size), ratio.size - left_out)
        return ratio[kept], vectors[:, kept]

    monkeypatch.setattr("dsm.spinning.frequencies.eigh", forgetful)
    with pytest.raises(ArithmeticError, match="rounding"):
        angular(unit_beam(4.0, CLAMPED), 4, 2.0)


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("spin", [0.0, 1.0, CANTILEVER[0], 10.0, 22.0, 100.0])
def test_a_round_beam_has_sums_and_differences(spin: float, count: int) -> None:
    planar = np.array(CANTILEVER)
    expected = np.sort(np.concatenate([np.abs(planar - spin), planar + spin]))[:count]
    assert angular(unit_beam(1.0, CLAMPED), count, spin) == pytest.approx(expected, rel=2e-11, abs=1e-10)


def test_units_of_a_round_steel_shaft() -> None:
    """f_1 = (pi/2) sqrt(EI / (m L^4)) Hz between pins; at 60 f_1 rpm, its critical speed, one frequency is 0."""
    rigidity, mass, length = 210e9 * math.pi * 0.03**4 / 64, 7850 * math.pi * 0.03**2 / 4, 0.8
    ends: list[tuple[float, SpinningDof]] = [(0.0, "u"), (0.0, "v"), (length, "u"), (length, "v")]
    beam = SpinningBeam([SpinningSegment(length, rigidity, rigidity, mass)], held=ends)
    first = math.pi / 2 * math.sqrt(rigidity / (mass * length**4))
    at_3000 = [first - 50, first + 50, 4 * first - 50, 4 * first + 50]
    assert spinning_frequencies(beam, 4, 3000.0) == pytest.approx(at_3000, rel=1e-11)
    assert spinning_frequencies(beam, 2, 60 * first) == pytest.approx([0, 2 * first], rel=1e-11, abs=1e-8 * first)


@pytest.mark.parametrize("spin", [0.5, 6.0, 30.0])
def test_a_beam_that_is_almost_round_comes_close_to_a_round_one(spin: float) -> None:
    springs = [SpinningSpring(0.1, 300.0), SpinningSpring(0.8, 500.0)]
    almost = angular(unit_beam(1 + 1e-8, springs=springs), 6, spin)
    assert almost == pytest.approx(angular(unit_beam(1.0, springs=springs), 6, spin), rel=1e-6)


def test_a_stiff_beam_on_springs_that_differ_by_axis() -> None:
    """It bounces: a = 2 kx / m and b = 2 ky / m; and it rocks: a = 6 kx / m and b = 6 ky / m."""
    kx, ky, spin = 8.0, 3.0, 1.5
    springs = [SpinningSpring(z, kx * 1e-6, ky * 1e-6) for z in (0.0, 1.0)]
    bounce = closed_form([math.sqrt(2 * ky)], kx / ky, spin)
    rock = closed_form([math.sqrt(6 * ky)], kx / ky, spin)
    found = 1e3 * angular(unit_beam(2.0, springs=springs), 4, spin * 1e-3)
    assert found == pytest.approx(sorted(bounce + rock), rel=1e-6)


def finite_elements(beam: SpinningBeam, spin: float, parts: int) -> tuple[NDArray[np.float64], int]:
    """Return w > 0 of the steady modes, ascending, and the number of growing modes, by Hermite elements.

    M x.. + 2 W G x. + (K - W^2 M) x = 0, all dofs of u before all dofs of v.
    """
    n = parts * len(beam.segments)
    size, node = 2 * n + 2, [0.0]
    stiffness, mass = np.zeros((2, size, size)), np.zeros((size, size))
    for e in range(n):
        segment = beam.segments[e // parts]
        h, at = segment.length / parts, slice(2 * e, 2 * e + 4)
        node.append(node[-1] + h)
        unit = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]
        unit += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
        stiffness[0, at, at] += np.array(unit) * segment.rigidity_yy / h**3
        stiffness[1, at, at] += np.array(unit) * segment.rigidity_xx / h**3
        inert = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]]
        inert += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
        mass[at, at] += np.array(inert) * segment.mass_per_length * h / 420
    for spring in beam.springs:
        dof = 2 * int(np.argmin(np.abs(np.array(node) - spring.position)))
        stiffness[0, dof, dof] += spring.stiffness_x
        stiffness[1, dof, dof] += spring.stiffness_x if spring.stiffness_y is None else spring.stiffness_y
    free = slice(2 if beam.held else 0, None)  # clamped at z = 0 or not held at all
    one, none = np.eye(size)[free, free], np.zeros((size, size))[free, free]
    u, v = (np.linalg.solve(mass[free, free], k[free, free]) - spin**2 * one for k in stiffness)
    position = np.block([[u, none], [none, v]])
    turning = 2 * spin * np.block([[none, -one], [one, none]])
    state = np.block([[np.zeros_like(position), np.eye(2 * len(one))], [-position, -turning]])
    root = np.linalg.eigvals(state)
    growing = np.sum(root.real > 1e-5 * np.abs(root))
    lasting = root[(np.abs(root.real) <= 1e-5 * np.abs(root)) & (root.imag > 0)]
    return np.sort(lasting.imag), int(growing)


def stepped(springs: Sequence[SpinningSpring] = (), held: Sequence[tuple[float, SpinningDof]] = ()) -> SpinningBeam:
    segments = [
        SpinningSegment(0.3, 1.0, 2.5, 0.8),
        SpinningSegment(0.5, 3.0, 0.9, 1.7),
        SpinningSegment(0.4, 0.6, 1.1, 0.5),
    ]
    return SpinningBeam(segments, springs, held)


SOFT = [SpinningSpring(0.3, 200.0, 90.0), SpinningSpring(0.8, 40.0)]


@pytest.mark.parametrize(
    ("beam", "spin", "unstable", "proved"),
    [
        (stepped(SOFT), 0.0, 0, 0),
        (stepped(SOFT), 5.0, 0, 0),
        (stepped(SOFT), 9.0, 0, 0),
        (stepped(SOFT), 14.0, 1, 1),
        (stepped(SOFT), 24.0, 0, 0),
        (stepped(SOFT), 30.0, 2, 0),
        (stepped(SOFT), 36.65, 0, 0),
        (stepped([*SOFT, SpinningSpring(0.3, 7.0, 20.0)]), 3.0, 0, 0),
        (stepped(SOFT), 100.0, 3, 1),
        (stepped(held=CLAMPED), 2.0, 0, 0),
        (stepped(held=CLAMPED), 3.5, 1, 1),
        (stepped(held=CLAMPED), 8.0, 0, 0),
        (stepped(held=CLAMPED), 10.0, 2, 0),
        (stepped(held=CLAMPED), 30.0, 0, 0),
    ],
)
def test_a_stepped_beam_equals_finite_elements(beam: SpinningBeam, spin: float, unstable: int, proved: int) -> None:
    """Also where two modes meet and grow (flutter): 2 grow and none is proved to."""
    expected, growing = finite_elements(beam, spin, 32)
    found, grows = with_growing(beam, 6, spin)
    assert grows == (unstable, proved)
    assert growing == unstable
    assert found == pytest.approx(expected[:6], rel=2e-6)


def test_few_modes_close_to_a_meeting_equal_the_first_of_many() -> None:
    """The coarsest start takes the two for flutter; the next finer one does not."""
    few, many = (with_growing(stepped(SOFT), count, 36.65) for count in (2, 6))
    assert few[1] == many[1] == (0, 0)
    assert few[0] == pytest.approx(many[0][:2], rel=1e-9)


sections = st.builds(SpinningSegment, *[st.floats(0.3, 3.0)] * 4)


@settings(max_examples=20, deadline=None)
@given(st.lists(sections, min_size=1, max_size=3), st.floats(1.0, 300.0), st.floats(1.0, 300.0), st.floats(0.0, 8.0))
def test_swapping_the_axes_changes_nothing(
    segments: list[SpinningSegment], stiffness_x: float, stiffness_y: float, spin: float
) -> None:
    swapped = [SpinningSegment(s.length, s.rigidity_yy, s.rigidity_xx, s.mass_per_length) for s in segments]
    clamp: list[tuple[float, SpinningDof]] = [(0.0, "u"), (0.0, "v"), (0.0, "u'"), (0.0, "v'")]
    end = math.fsum(segment.length for segment in segments)
    beam = SpinningBeam(segments, [SpinningSpring(end, stiffness_x, stiffness_y)], [*clamp, (end, "u'")])
    mirror = SpinningBeam(swapped, [SpinningSpring(end, stiffness_y, stiffness_x)], [*clamp, (end, "v'")])
    try:
        found, other = with_growing(beam, 3, spin), with_growing(mirror, 3, spin)
    except ArithmeticError:  # at a critical speed, or where two modes meet
        reject()
    assert found[1] == other[1]
    assert found[0] == pytest.approx(other[0], rel=1e-7, abs=1e-7)


def test_many_modes_and_pieces_none_missed() -> None:
    expected = closed_form([(n * math.pi) ** 2 for n in range(1, 30)], 1.7, 60.0)[:30]
    assert angular(unit_beam(1.7, PINNED, pieces=7), 30, 60.0) == pytest.approx(expected, rel=1e-9)


GOOD = SpinningSegment(1.0, 1.0, 2.0, 1.0)


@pytest.mark.parametrize(
    ("message", "segments", "springs", "held"),
    [
        ("segments", [], [], []),
        ("segment 2: length=0", [GOOD, SpinningSegment(0.0, 1.0, 1.0, 1.0)], [], []),
        ("segment 1: rigidity_yy=nan", [SpinningSegment(1.0, 1.0, math.nan, 1.0)], [], []),
        ("spring 1: position=1.1 m .*0 to 1 m", [GOOD], [SpinningSpring(1.1, 1.0)], []),
        ("spring 1: stiffness_y=-1", [GOOD], [SpinningSpring(0.1, 1.0, -1.0)], []),
        ("spring 1: stiffness_x=inf .* dof", [GOOD], [SpinningSpring(0.1, math.inf)], []),
        ("held: position=-0.1 m", [GOOD], [], [(-0.1, "u")]),
        ("held: dof='w'", [GOOD], [], [(0.1, "w")]),
    ],
)
def test_rejects_what_is_no_beam(
    message: str, segments: list[SpinningSegment], springs: list[SpinningSpring], held: list[tuple[float, SpinningDof]]
) -> None:
    with pytest.raises(ValueError, match=message):
        SpinningBeam(segments, springs, held)


@pytest.mark.parametrize(
    "beam",
    [
        unit_beam(2.0),
        unit_beam(2.0, [(0.0, "u"), (0.0, "v")]),
        unit_beam(2.0, [(0.0, "u"), (1.0, "u"), (0.0, "v'"), (1.0, "v'")]),
        unit_beam(2.0, springs=[SpinningSpring(0.0, 1.0), SpinningSpring(1.0, 1.0, 0.0)]),
    ],
    ids=["free", "hinge", "v slides", "no spring along v"],
)
def test_rejects_a_beam_that_moves_without_bending(beam: SpinningBeam) -> None:
    with pytest.raises(ValueError, match="plane"):
        spinning_frequencies(beam, 1, 10.0)


@pytest.mark.parametrize(("count", "speed_rpm"), [(0, 1.0), (2, -1.0), (2, math.nan)])
def test_rejects_counts_and_speeds(count: int, speed_rpm: float) -> None:
    with pytest.raises(ValueError, match=r"0 modes|speed_rpm="):
        spinning_frequencies(unit_beam(4.0, CLAMPED), count, speed_rpm)
