"""H1, H2 and Hv, their phase, coherence and random error, on structures whose FRF is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import (
    Channel,
    Frf,
    HammeredStructure,
    Hit,
    SimulatedSource,
    Trigger,
    capture_hits,
    check_hit,
    compute_cross_spectra,
    estimate_frf,
    from_accelerance,
)

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Receptance = Callable[[NDArray[np.float64]], NDArray[np.complex128]]


def hits(tapper: Tapper, channels: Pair, count: int = 10, **hammering: object) -> list[Hit]:
    source = SimulatedSource(tapper(**hammering), channels, RATE, 300_000)
    good = [hit for hit in capture_hits(source, Trigger(20.0, 6400, 512)) if not check_hit(hit)]
    return good[:count]


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_ten_hits_give_the_true_receptance_in_size_and_phase(
    estimator: str, tapper: Tapper, channels: Pair, true_receptance: Receptance
) -> None:
    quiet = hits(tapper, channels, force_noise=0.05, response_noise=0.2)
    frf = estimate_frf(quiet, estimator).in_band((600.0, 3200.0))  # type: ignore[arg-type]
    truth = true_receptance(frf.frequency)
    assert np.max(np.abs(frf.receptance - truth)) < 2e-3 * np.max(np.abs(truth))
    assert frf.n_averages == 10
    assert frf.measured_as == "accelerance"
    peak = int(np.argmax(np.abs(frf.receptance)))
    assert frf.receptance[peak].imag < 0, "a driving point lags the force"


def test_noise_on_the_response_lowers_h2_not_h1(tapper: Tapper, channels: Pair, true_receptance: Receptance) -> None:
    noisy = hits(tapper, channels, response_noise=15.0)
    frfs = {name: estimate_frf(noisy, name).in_band((1500.0, 1950.0)) for name in ("H1", "H2", "Hv")}
    truth = true_receptance(frfs["H1"].frequency)
    size = {name: float(np.mean(np.abs(frf.receptance) / np.abs(truth))) for name, frf in frfs.items()}
    assert size["H1"] < size["Hv"] < size["H2"]
    assert size["H1"] == pytest.approx(1, abs=0.01)


def test_random_error_says_how_far_the_estimate_is_from_the_truth(
    tapper: Tapper, channels: Pair, true_receptance: Receptance
) -> None:
    frf = estimate_frf(hits(tapper, channels, response_noise=15.0)).in_band((800.0, 2500.0))
    error = np.abs(frf.receptance) / np.abs(true_receptance(frf.frequency)) - 1
    assert frf.random_error is not None
    assert 0.7 < np.std(error) / np.sqrt(np.mean(frf.random_error**2)) < 1.4


def test_one_hit_has_no_coherence_and_two_no_random_error(tapper: Tapper, channels: Pair) -> None:
    assert estimate_frf(hits(tapper, channels, 1)).coherence is None
    two = estimate_frf(hits(tapper, channels, 2))
    assert two.coherence is not None
    assert two.random_error is None


def test_usable_band_ends_where_the_force_has_fallen_by_20_db(tapper: Tapper, channels: Pair) -> None:
    width = 0.6e-3
    (hit,) = hits(tapper, channels, 1, width_range=(width, width), force_noise=0.0)
    time = np.arange(0, width, 1e-7)
    spectrum = {
        f: abs(np.trapezoid(np.sin(np.pi * time / width) ** 4 * np.exp(-2j * np.pi * f * time), time))
        for f in (4.0, 4500.0)
    }
    band = estimate_frf([hit]).usable_band
    assert band is not None
    edge = abs(np.trapezoid(np.sin(np.pi * time / width) ** 4 * np.exp(-2j * np.pi * band[1] * time), time))
    assert edge / spectrum[4.0] == pytest.approx(0.1, rel=0.02)
    assert band[1] < 4500.0


def few_codes(tapper: Tapper) -> list[Hit]:
    """Hits whose force has no power at half the sample rate, the last line."""
    coarse = Channel("force", 2.25e-3, 4.5, 12), Channel("acceleration", 1.02e-3, 5.0, 12)
    taken = hits(tapper, coarse, 99, force_range=(200.0, 200.0), force_noise=0.0)
    powers = [compute_cross_spectra([hit])[0] for hit in taken]
    without = [hit for hit, power in zip(taken, powers, strict=True) if power[-1] < 1e-32 * power.max()]
    assert len(without) >= 2
    return without


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_lines_that_no_hit_excites_are_zero_and_beyond_the_band(tapper: Tapper, estimator: Literal["H1"]) -> None:
    some = few_codes(tapper)
    frf, single = estimate_frf(some, estimator), estimate_frf(some[:1], estimator)
    for one in (frf, single):
        assert one.receptance[-1] == 0
        assert one.usable_band is not None
        assert one.usable_band[1] < one.frequency[-1]
    assert frf.coherence is not None
    assert frf.coherence[-1] == 0
    s_ff, s_xx, s_fx = (spectrum[1:-1] for spectrum in compute_cross_spectra(some))
    forms = {"H1": s_fx / s_ff, "H2": s_xx / np.conj(s_fx), "Hv": s_fx / np.abs(s_fx) * np.sqrt(s_xx / s_ff)}
    rising = s_ff > 1e-9 * np.max(s_ff)
    assert frf.accelerance[:-1][rising] == pytest.approx(forms[estimator][rising], rel=1e-9)
    assert frf.coherence[:-1][rising] == pytest.approx((np.abs(s_fx) ** 2 / s_ff / s_xx)[rising], rel=1e-9)


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_an_accelerometer_that_gives_nothing_has_a_receptance_and_a_coherence_of_zero(
    tapper: Tapper, channels: Pair, estimator: Literal["H1"]
) -> None:
    dead = [replace(hit, acceleration=np.zeros(6400)) for hit in hits(tapper, channels, 3)]
    frf = estimate_frf(dead, estimator)
    assert not frf.receptance.any()
    assert frf.coherence is not None
    assert not frf.coherence.any()


def test_skew_of_the_response_channel_is_corrected(tapper: Tapper, channels: Pair) -> None:
    straight = estimate_frf(hits(tapper, channels))
    force, response = channels
    skewed = [replace(hit, channels=(force, replace(response, skew=2e-6))) for hit in hits(tapper, channels)]
    turned = estimate_frf(skewed).receptance / straight.receptance
    assert np.angle(turned) == pytest.approx(-2 * np.pi * straight.frequency * 2e-6, abs=1e-9)


def test_an_offset_of_force_and_response_changes_nothing(tapper: Tapper, channels: Pair) -> None:
    plain = hits(tapper, channels)
    offset = [replace(hit, force=hit.force + 3.0, acceleration=hit.acceleration - 5.0) for hit in plain]
    assert estimate_frf(offset).receptance == pytest.approx(estimate_frf(plain).receptance, rel=1e-9)


def test_zero_hertz_is_left_out_and_forms_agree() -> None:
    frf = from_accelerance([0.0, 1.0, 2.0], [1.0, 1.0, 1j])
    assert frf.frequency.tolist() == [1.0, 2.0]
    assert frf.receptance == pytest.approx(np.array([-1 / (2 * np.pi) ** 2, -1j / (4 * np.pi) ** 2]))
    assert frf.accelerance == pytest.approx(np.array([1.0, 1j]))
    assert frf.mobility == pytest.approx(frf.accelerance / (2j * np.pi * frf.frequency))


def test_bad_calls_are_rejected(tapper: Tapper, channels: Pair) -> None:
    (hit,) = hits(tapper, channels, 1)
    with pytest.raises(ValueError, match="0 hits"):
        estimate_frf([])
    with pytest.raises(ValueError, match=r"'H3' .*H1, H2, Hv"):
        estimate_frf([hit], "H3")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"\(\d+, \d+\.0\), \(\d+, \d+\.0\)"):
        estimate_frf([hit, replace(hit, sample_rate=51200.0)])
    with pytest.raises(ValueError, match="pulse"):
        estimate_frf([replace(hit, force=np.zeros(6400))])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 2.0], [1.0, np.nan]), "not finite at 1 lines, first at 2 Hz"),
        (([1.0, 2.0], [1.0, 1e60]), "larger than 1e\\+50 at 1 lines, first at 2 Hz"),
        (([1.0, 2.0], [1.0]), r"\(1,\) .*\(2,\)"),
        (([2.0, 1.0], [1.0, 1.0]), "frequency"),
        (([1.0], [1.0]), r"2 lines.*\(1,\)"),
        (([1.0, 2.0], [1.0, 1.0], [0.5, 1.5]), "coherence .*0 and 1"),
        (([1.0, 2.0], [1.0, 1.0], [0.5]), "coherence"),
        (([1.0, 2.0], [1.0, 1.0], None, 0), "n_averages=0"),
        (([1.0, 2.0], [1.0, 1.0], None, 1, "compliance"), "measured_as='compliance'"),
    ],
)
def test_an_frf_that_is_none_is_rejected(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Frf(*arguments)  # type: ignore[arg-type]


def test_a_band_outside_the_axis_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"band 10\.\.20 Hz .*0 lines"):
        Frf(np.array([1.0, 2.0]), np.array([1.0, 1.0])).in_band((10.0, 20.0))
