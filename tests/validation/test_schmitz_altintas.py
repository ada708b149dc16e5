"""Average-tooth-angle limits that stand in print or have a closed form.

T. L. Schmitz, K. S. Smith, Machining Dynamics, 2nd ed., Springer 2019, Example 4.3 (limits at single speeds computed
for this project from its data).
Y. Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, orthogonal shaping with two oblique modes.
O. Gaber, S. M. Hashemi: modal stiffness ratio of an aged spindle, 1722 -> 1550 Hz.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from lobes import Cut, StabilityLobes, average_angle_lobes
from modal import Mode


def slot(teeth: int = 4) -> Cut:
    """Slot in aluminium of Ex. 4.3: Ks = 750 MPa at beta = 68 deg."""
    beta = math.radians(68)
    return Cut(teeth, 1.0, "up", 750e6 * math.sin(beta), 750e6 * math.cos(beta))


MODE = Mode(500.0, 0.02, 8e6)


def loop_gain(cut: Cut) -> float:
    """Ks mu_x Nt* (N/m^2)."""
    return cut.specific_force * cut.orientation_factors[0] * cut.teeth_in_cut


def best_speed(chatter: float, mode: Mode, teeth: int, lobe: int) -> float:
    """Lobe speed (rpm) in Schmitz & Smith's own form, eps = 2 pi - 2 atan(Re/Im)."""
    response = mode.receptance(np.array([chatter]))[0]
    eps = 2 * math.pi - 2 * math.atan(response.real / response.imag)
    return 60 * chatter / (teeth * (lobe + eps / (2 * math.pi)))


def test_example_4_3_orientation_and_teeth_in_cut() -> None:
    assert slot().orientation_factors == pytest.approx((0.374607, 0.0), abs=5e-7)
    assert slot().teeth_in_cut == pytest.approx(2.0)


def test_example_4_3_limits_at_five_speeds() -> None:
    lobes = average_angle_lobes([MODE], None, slot(), [3000, 4500, 6000, 7400, 9000])
    assert lobes.depth * 1e3 == pytest.approx([0.8489, 0.6032, 3.5954, 8.8163, 0.6884], abs=5e-5)
    assert list(lobes.kind) == ["hopf"] * 5
    assert lobes.method == "average angle"


@pytest.mark.parametrize("lobe", [0, 1, 2, 3, 20])
def test_example_4_3_minimum_of_each_lobe(lobe: int) -> None:
    speed = best_speed(500 * math.sqrt(1.04), MODE, 4, lobe)
    lobes = average_angle_lobes([MODE], None, slot(), speed)
    assert lobes.depth[0] * 1e3 == pytest.approx(0.58088, abs=5e-6)
    assert lobes.chatter_frequency[0] == pytest.approx(509.902, abs=5e-4)


@pytest.mark.parametrize("mode", [MODE, Mode(1722.0, 0.029136, 3.2289e7), Mode(80.0, 0.3, 1e5)])
@pytest.mark.parametrize("teeth", [1, 5])
def test_closed_form_of_one_mode(mode: Mode, teeth: int) -> None:
    zeta, cut = mode.damping_ratio, slot(teeth)
    chatter = mode.frequency * math.sqrt(1 + 2 * zeta)
    lobes = average_angle_lobes([mode], None, cut, best_speed(chatter, mode, teeth, 2))
    expected = 2 * mode.stiffness * zeta * (1 + zeta) / loop_gain(cut)
    assert lobes.depth[0] == pytest.approx(expected, rel=1e-12)
    assert lobes.chatter_frequency[0] == pytest.approx(chatter, rel=1e-7)


def test_closed_form_where_the_orientation_is_negative() -> None:
    """A negative mu_x turns the real part over: chatter below f_n, b_min = 2 k zeta (1 - zeta) / (Ks |mu| Nt*)."""
    cut = Cut(3, 0.1, "down", 600e6, 200e6)
    mode, zeta = Mode(800.0, 0.04, 2e7), 0.04
    assert cut.orientation_factors[0] < 0
    lobes = average_angle_lobes([mode], None, cut, np.linspace(5000, 15000, 20001))
    assert lobes.minimum.depth == pytest.approx(2 * 2e7 * zeta * (1 - zeta) / -loop_gain(cut), rel=1e-6)
    assert lobes.minimum.chatter_frequency == pytest.approx(800 * math.sqrt(1 - 2 * zeta), rel=1e-4)


def test_paper_stiffness_ratio_of_the_aged_spindle() -> None:
    """2 k zeta (1 + zeta) = 1936365.29 -> 1742728.76 N/m: the limit falls with it to 0.90000."""
    products = []
    for frequency, stiffness in ((1722.0, 3.2289e7), (1550.0, 2.90601e7)):
        mode = Mode(frequency, 0.029136, stiffness)
        speed = best_speed(frequency * math.sqrt(1 + 2 * 0.029136), mode, 4, 3)
        products.append(average_angle_lobes([mode], None, slot(), speed).depth[0] * loop_gain(slot()))
    assert products == pytest.approx([1936365.29, 1742728.76], abs=0.005)
    assert products[1] / products[0] == pytest.approx(0.90000, abs=5e-6)


@pytest.mark.parametrize(("depth_mm", "chatter", "waves"), [(7.18498, 252.980, 1.75), (9.45843, 151.491, 3.75)])
def test_altintas_shaping_with_two_oblique_modes(depth_mm: float, chatter: float, waves: float) -> None:
    """Modes at 30 and -45 deg to the cut count with cos^2 of their angle; Kf = 1000 MPa, a_lim = -1/(2 Kf Re G)."""
    modes = [
        Mode(250.0, 0.012, 2.26e8 / math.cos(math.radians(30)) ** 2),
        Mode(150.0, 0.010, 2.13e8 / math.cos(math.radians(45)) ** 2),
    ]
    cut = slot(1)

    def lobes_at(waves: float) -> StabilityLobes:
        return average_angle_lobes(modes, None, cut, 60 * chatter / waves)

    found = minimize_scalar(lambda w: lobes_at(w).depth[0], bounds=(waves - 0.1, waves + 0.1), options={"xatol": 1e-9})
    lobes = lobes_at(found.x)
    assert lobes.depth[0] * 1e3 * loop_gain(cut) / 1000e6 == pytest.approx(depth_mm, abs=5e-6)
    assert lobes.chatter_frequency[0] == pytest.approx(chatter, abs=5e-4)


def marching_multiplier(mode: Mode, gain: float, delay: float, steps: int = 200) -> tuple[float, float]:
    """Growth per delay and frequency (Hz) of m q'' + c q' + k q = -gain (q(t) - q(t - delay)).

    One implicit midpoint step as a matrix on (q, q', older q ...); growth is its largest eigenvalue ^ steps.
    """
    h, w = delay / steps, 2 * math.pi * mode.frequency
    pull = gain * w**2 / mode.stiffness
    now = np.array([[0.0, 1.0], [-(w**2) - pull, -2 * mode.damping_ratio * w]])
    left = np.linalg.inv(np.eye(2) - h / 2 * now)
    march: NDArray[np.float64] = np.zeros((steps + 2, steps + 2))
    march[:2, :2] = left @ (np.eye(2) + h / 2 * now)
    march[:2, -2:] = np.outer(left @ [0.0, h * pull], [0.5, 0.5])
    march[2, 0] = 1.0
    march[3:, 2:-1] = np.eye(steps - 1)
    values = np.linalg.eigvals(march)
    largest = values[np.argmax(np.abs(values))]
    return float(np.abs(largest) ** steps), float(abs(np.angle(largest)) / (2 * math.pi * h))


@pytest.mark.parametrize(
    ("cut", "speed"),
    [
        (slot(), 7400.0),
        (slot(), 9000.0),
        (slot(), 24000.0),
        (Cut(3, 0.1, "down", 600e6, 200e6), 8000.0),
        (Cut(3, 0.1, "down", 600e6, 200e6), 11000.0),
    ],
)
def test_the_averaged_equation_grows_above_the_limit_and_decays_below(cut: Cut, speed: float) -> None:
    lobes = average_angle_lobes([MODE], None, cut, speed)
    delay = 60 / (cut.teeth * speed)
    above, chatter = marching_multiplier(MODE, 1.03 * lobes.depth[0] * loop_gain(cut), delay)
    below, _ = marching_multiplier(MODE, 0.97 * lobes.depth[0] * loop_gain(cut), delay)
    assert below < 1 < above
    assert lobes.chatter_frequency[0] == pytest.approx(chatter, rel=0.01)
