"""A mode whose modal constant is not real: its receptance, and invalid modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modal import Mode

pytestmark = pytest.mark.quick

LINES = np.linspace(5.0, 4000.0, 800)


@pytest.mark.parametrize("phase", [-70.0, 0.0, 25.0])
@pytest.mark.parametrize("stiffness", [3e7, -3e7])
def test_receptance_is_that_of_residue_and_pole(phase: float, stiffness: float) -> None:
    mode = Mode(1500.0, 0.05, stiffness, phase_deg=phase)
    w_n, zeta = 2 * np.pi * 1500.0, 0.05
    w_d = w_n * np.sqrt(1 - zeta**2)
    pole, s = -zeta * w_n + 1j * w_d, 2j * np.pi * LINES
    residue = np.exp(1j * np.radians(phase)) / stiffness * w_n**2 / (2j * w_d)
    expected = residue / (s - pole) + residue.conjugate() / (s - pole.conjugate())
    assert mode.receptance(LINES) == pytest.approx(expected, rel=1e-12)
    assert np.angle(residue * 2j * w_d * np.sign(stiffness), deg=True) == pytest.approx(phase)


def test_joint_covariance_holds_the_phase() -> None:
    cov = np.diag([4.0, 1e-8, 9e8])
    mode = Mode(1500.0, 0.05, 3e7, cov, phase_deg=10.0, phase_deg_std=0.5, phase_correlation=np.array([0.7, 0.0, 0.1]))
    joint = mode.joint_covariance
    assert joint[:3, :3] == pytest.approx(cov)
    assert joint[3] == pytest.approx([0.7 * 2 * 0.5, 0.0, 0.1 * 3e4 * 0.5, 0.25])
    assert joint[:, 3] == pytest.approx(joint[3])


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"phase_deg": 135.0}, "phase_deg=135.0 .*-90 to 90"),
        ({"phase_deg": np.nan}, "phase_deg=nan"),
        ({"phase_deg_std": -1.0}, "phase_deg_std=-1.0"),
        ({"phase_deg": 10.0, "damping_ratio": 1.5}, "damping_ratio=1.5 .*phase_deg=10.0"),
    ],
)
def test_what_is_no_mode_is_rejected(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(Mode(1500.0, 0.05, 3e7), **wrong)  # type: ignore[arg-type]
