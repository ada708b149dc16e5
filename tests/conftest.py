"""What several tests share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Channel, HammeredStructure, Hammering, Structure

DATA = Path(__file__).parent / "data"


@pytest.fixture
def beam() -> Path:
    """A clean real hammer hit on a beam: force in N, acceleration in g."""
    return DATA / "ladisk_beam" / "acceleration.lvm"


@pytest.fixture
def clipped_beam() -> Path:
    """A real hit whose accelerometer was clipped."""
    return DATA / "ladisk_beam" / "camera.lvm"


@pytest.fixture
def cnc_csv() -> Path:
    """A real CNC tap test without a force channel."""
    return DATA / "rpi_cnc_tap" / "tap_20260622_163222.csv"


@pytest.fixture
def channels() -> tuple[Channel, Channel]:
    """Hammer and accelerometer on a 16-bit converter."""
    return Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)


@pytest.fixture
def structure() -> Structure:
    """Three modes and a static residual."""
    return Structure(
        frequency=np.array([900.0, 1722.0, 3000.0]),
        damping_ratio=np.array([0.03, 0.029136, 0.02]),
        stiffness=np.array([8e7, 3.2289e7, 1e8]),
        residual=1e-9,
    )


Tapper = Callable[..., HammeredStructure]


@pytest.fixture
def tapper(structure: Structure) -> Tapper:
    """Makes somebody who taps `structure` at 25.6 kHz; without faults unless asked for."""

    def make(seed: int = 1, **hammering: object) -> HammeredStructure:
        faultless: dict[str, object] = {"double_hits": 0.0, "overloads": 0.0}
        how = Hammering(**(faultless | hammering))  # type: ignore[arg-type]
        return HammeredStructure(structure, 25600.0, np.random.default_rng(seed), how)

    return make


@pytest.fixture
def true_receptance(structure: Structure) -> Callable[[NDArray[np.float64]], NDArray[np.complex128]]:
    """Receptance (m/N) of `structure` at frequencies (Hz)."""

    def at(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        r = frequency[:, None] / structure.frequency
        modes = 1 / (structure.stiffness * (1 - r**2 + 2j * structure.damping_ratio * r))
        return np.asarray(modes.sum(axis=1) + structure.residual)

    return at
