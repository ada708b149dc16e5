"""F = m a of a hung mass whose hammer and accelerometer are wrong by known factors."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import (
    Channel,
    HammeredStructure,
    Hammering,
    Hit,
    Structure,
    TapsEmulator,
    TapsSource,
    Trigger,
    calibrate_by_mass,
    capture_hits,
)

RATE = 25600.0
MASS = 1.2
TRUE = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))


def hung_mass(mass: float, mount: float = np.inf) -> Structure:
    """Return a mass on threads (pendulum of 1.2 Hz) with the accelerometer on a mount with a resonance (Hz).

    Behind the mount the accelerance is 1/m / (1 - (f/f_m)^2) = 1/m + the mode f_m with modal stiffness -m (2 pi f_m)^2.
    """
    frequency, damping = np.array([1.2, mount]), np.array([0.3, 0.02])
    stiffness = mass * (2 * np.pi * frequency) ** 2 * [1, -1]
    n = 2 if np.isfinite(mount) else 1
    return Structure(frequency[:n], damping[:n], stiffness[:n])


def hits_on(
    structure: Structure, count: int = 10, believed: tuple[Channel, Channel] = TRUE, **how: object
) -> list[Hit]:
    """Return hits recorded with the true sensitivities and read with the assumed ones."""
    faultless: dict[str, object] = {
        "double_hits": 0.0,
        "overloads": 0.0,
        "interval_range": (0.3, 0.35),
        "response_noise": 0.2,
    }
    tapping = Hammering(**(faultless | how))  # type: ignore[arg-type]
    signal = HammeredStructure(structure, RATE, np.random.default_rng(3), tapping)
    with TapsEmulator(signal, TRUE, RATE, realtime=False) as device, TapsSource(device.port) as source:
        source.start()
        taken = list(islice(capture_hits(source, Trigger(20.0, 6400, 512)), count))
        source.stop()
    assert all(hit.codes is not None for hit in taken)
    return [Hit.from_codes(hit.codes, believed, RATE, hit.pre_trigger) for hit in taken]  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def true_hits() -> list[Hit]:
    return hits_on(hung_mass(MASS))


def misread(hits: list[Hit], force: float = 1.0, acceleration: float = 1.0) -> list[Hit]:
    """Return the same hits with sensitivities wrong by these factors."""
    believed = (
        replace(TRUE[0], sensitivity=TRUE[0].sensitivity * force),
        replace(TRUE[1], sensitivity=TRUE[1].sensitivity * acceleration),
    )
    return [Hit.from_codes(hit.codes, believed, RATE, hit.pre_trigger) for hit in hits]  # type: ignore[arg-type]


def test_right_sensitivities_agree(true_hits: list[Hit]) -> None:
    found = calibrate_by_mass(true_hits, MASS)
    assert found.ratio == pytest.approx(1, abs=4 * found.ratio_std)
    assert 0 < found.ratio_std < 5e-4
    assert abs(found.phase) < 0.5
    assert abs(found.flatness) < 0.01
    assert found.band[0] == pytest.approx(52.0)
    assert 2000 < found.band[1] < 4000
    assert found.agrees
    assert found.n_hits == 10
    assert found.remarks == ()
    assert "5%" in str(found).splitlines()[-1]


def test_a_force_sensitivity_believed_too_small_reads_the_force_too_large(true_hits: list[Hit]) -> None:
    found = calibrate_by_mass(misread(true_hits, force=1 / 1.2), MASS)
    assert found.ratio == pytest.approx(1.2, rel=1e-3)
    assert not found.agrees
    assert found.force_sensitivity == pytest.approx(2.25e-3, rel=1e-3)
    assert "force is 20.0%" in str(found)
    assert re.search(r"2\.25 mV/N .*1\.875", str(found))


def test_an_acceleration_sensitivity_believed_too_small_reads_the_acceleration_too_large(true_hits: list[Hit]) -> None:
    found = calibrate_by_mass(misread(true_hits, acceleration=1 / 1.1), MASS)
    assert found.ratio == pytest.approx(1 / 1.1, rel=1e-3)
    assert found.acceleration_sensitivity == pytest.approx(1.02e-3, rel=1e-3)
    assert "acceleration is 10.0%" in str(found)
    assert re.search(r"1\.02 mV per m/s\^2 .*0\.9273", str(found))


def test_a_wrong_mass_counts_like_a_wrong_sensitivity(true_hits: list[Hit]) -> None:
    plain, heavy = calibrate_by_mass(true_hits, MASS), calibrate_by_mass(true_hits, 1.25 * MASS)
    assert heavy.ratio == pytest.approx(plain.ratio / 1.25, rel=1e-9)
    (remark,) = heavy.remarks
    assert remark.code == "sensitivities-disagree"
    assert "mass" in remark.cure


@given(st.floats(0.01, 100), st.floats(0.01, 100))
@settings(max_examples=20)
def test_the_ratio_is_that_of_the_sensitivities(force: float, acceleration: float) -> None:
    found = calibrate_by_mass(misread(HITS, force, acceleration), MASS)
    plain = calibrate_by_mass(HITS, MASS)
    assert found.ratio == pytest.approx(plain.ratio * acceleration / force, rel=1e-9)
    assert found.ratio_std == pytest.approx(plain.ratio_std * acceleration / force, rel=1e-6)


HITS = hits_on(hung_mass(MASS), 3)


def test_opposite_signs_are_reported(true_hits: list[Hit]) -> None:
    turned = [replace(hit, acceleration=-hit.acceleration) for hit in true_hits]
    found = calibrate_by_mass(turned, MASS)
    assert found.inverted
    assert not found.agrees
    assert found.ratio == pytest.approx(1, abs=2e-3)
    assert abs(found.phase) < 0.5
    assert [remark.code for remark in found.remarks] == ["opposite-signs"]


def test_the_foot_of_a_mounts_resonance_does_not_bend_the_ratio() -> None:
    found = calibrate_by_mass(hits_on(hung_mass(MASS, mount=3000.0)), MASS)
    assert found.ratio == pytest.approx(1, abs=2e-3)
    assert found.flatness == pytest.approx(-0.05, abs=0.01)
    assert found.band[1] == pytest.approx(3000 * np.sqrt(0.05), rel=0.15)


def test_a_soft_mount_leaves_no_band() -> None:
    with pytest.raises(ValueError, match=r"\d+ FRF lines from 50 Hz .*20 "):
        calibrate_by_mass(hits_on(hung_mass(MASS, mount=200.0)), MASS)


def test_the_standard_error_is_that_over_the_hits() -> None:
    hits = hits_on(hung_mass(MASS), 60, response_noise=3.0)
    sets = [calibrate_by_mass(hits[i : i + 5], MASS) for i in range(0, 60, 5)]
    seen = np.std([found.ratio for found in sets], ddof=1)
    said = np.sqrt(np.mean([found.ratio_std**2 for found in sets]))
    assert 0.6 < seen / said < 1.6


@pytest.mark.parametrize(
    ("force", "acceleration", "words"),
    [
        (1.0, 9.80665, "by 9.80665"),
        (1.0, 1 / 9.80665, "V per m/s^2"),
        (4.44822, 1.0, "V/lbf"),
        (1 / 4.44822, 1.0, "V/N"),
        (1e-3, 1.0, "force 1000 times too large"),
        (1e3, 1.0, "force 1000 times too small"),
    ],
)
def test_unit_mistakes_are_named(true_hits: list[Hit], force: float, acceleration: float, words: str) -> None:
    found = calibrate_by_mass(misread(true_hits, force, acceleration), MASS)
    assert [remark.code for remark in found.remarks] == ["sensitivities-disagree", "unit-mistake"]
    assert words in str(found)


def test_a_skewed_phase_is_reported(true_hits: list[Hit]) -> None:
    skewed = [replace(hit, channels=(TRUE[0], replace(TRUE[1], skew=60e-6))) for hit in true_hits]
    (remark,) = calibrate_by_mass(skewed, MASS).remarks
    assert remark.code == "phase-not-rigid"
    assert re.search(r"[+-]\d+\.\d deg", remark.text)
    assert "skew" in remark.cure


def test_bad_calls_are_rejected(true_hits: list[Hit]) -> None:
    for mass in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"mass={mass} kg"):
            calibrate_by_mass(true_hits, mass)
    with pytest.raises(ValueError, match=r"2 good hits .*3"):
        calibrate_by_mass(true_hits[:2], MASS)


def test_hits_without_channels_have_no_new_sensitivities(true_hits: list[Hit]) -> None:
    bare: Callable[[Hit], Hit] = lambda hit: Hit(1.2 * hit.force, hit.acceleration, RATE, hit.pre_trigger)  # noqa: E731
    found = calibrate_by_mass([bare(hit) for hit in true_hits], MASS)
    assert found.force_sensitivity is None
    assert found.acceleration_sensitivity is None
    assert "mV" not in str(found)
