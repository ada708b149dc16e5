"""Standard errors: over the hits (jackknife), and from the residual of the fit with the noise of the hammer."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm, t

from acquisition import Frf, Hit, Structure, estimate_frf, from_accelerance
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tap.emulated_spindle import EMULATED_SAMPLE_RATE, build_structure
from modal import Mode, extract_modes, fit_common_modes, fit_modes, synthesize_frf
from modal.hit_scatter import jackknife_covariance, leave_one_out_frfs

STRONG, WEAK = Mode(1500.0, 0.03, 3e7), Mode(1900.0, 0.03, 1.5e9)
RECORD, PRE_TRIGGER = 6400, 512
"""0.25 s and 0.02 s, the demo's."""


def demo_structure() -> Structure:
    table = parse_machine_file(
        resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
    ).spindle
    assert table is not None
    return build_structure(table.build(), table.damping_ratio)


STRUCTURE = demo_structure()
TRUTH = np.array([STRUCTURE.frequency[0], STRUCTURE.damping_ratio[0], STRUCTURE.stiffness[0]])


def tap(seed: int, hits: int = 10, hammer_noise: float = 0.1, sensor_noise: float = 2.0) -> list[Hit]:
    """Good hits as the demo's hammerer gives them: 150..350 N, 0.55..0.75 ms, white noise on both channels."""
    random = np.random.default_rng(seed)
    made = []
    for _ in range(hits):
        peak, width = random.uniform(150, 350), random.uniform(0.55e-3, 0.75e-3)
        time = (np.arange(RECORD) - PRE_TRIGGER + random.uniform()) / EMULATED_SAMPLE_RATE
        after = time >= 0
        force = np.where(after & (time <= width), np.sin(np.pi * time / width) ** 4, 0.0)
        response = np.zeros(RECORD)
        response[after] = STRUCTURE.response(time[after], width)
        force = peak * force + random.normal(scale=hammer_noise, size=RECORD)
        response = peak * response + random.normal(scale=sensor_noise, size=RECORD)
        made.append(Hit(force, response, EMULATED_SAMPLE_RATE, PRE_TRIGGER))
    return made


def first_mode(hits: list[Hit]) -> Mode:
    return fit_modes(estimate_frf(hits), hits=hits)[0]


def one_average(modes: list[Mode], lines: NDArray[np.float64], level: float, seed: int) -> Frf:
    """FRF without hits; white noise of level times the largest accelerance on it."""
    exact = synthesize_frf(modes, lines).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, lines.size)) / np.sqrt(2) * level * np.max(np.abs(exact))
    return from_accelerance(lines, exact + noise[0] + 1j * noise[1])


def values(mode: Mode) -> NDArray[np.float64]:
    return np.array([mode.frequency, mode.damping_ratio, mode.stiffness])


def test_both_errors_are_in_the_result_and_the_hits_decide() -> None:
    mode = first_mode(tap(0))
    assert mode.n_hits == 10
    assert mode.covariance is not None
    assert mode.jackknife is not None
    assert mode.standard_error == pytest.approx(np.sqrt(np.diag(mode.jackknife)))
    assert mode.fit_error == pytest.approx(np.sqrt(np.diag(mode.covariance)))
    assert np.all(np.abs(values(mode) - TRUTH) < 4 * mode.standard_error)


def test_jackknife_of_several_frfs_leaves_out_one_hit_of_one_at_a_time() -> None:
    sets = [tap(1), tap(2, hits=6)]
    frfs = [estimate_frf(hits) for hits in sets]
    (mode, *_), (bare, *_) = fit_common_modes(frfs, hits=sets), fit_common_modes(frfs)
    variance = np.zeros(3)
    for i, hits in enumerate(sets):
        without = [estimate_frf(hits[:k] + hits[k + 1 :]) for k in range(len(hits))]
        left = np.array([values(fit_common_modes([*frfs[:i], one, *frfs[i + 1 :]])[0]) for one in without])
        variance += (1 - 1 / len(hits)) * np.sum((left - left.mean(axis=0)) ** 2, axis=0)
    assert mode.n_hits == 6
    assert mode.standard_error[1:] == pytest.approx(np.sqrt(variance[1:]), rel=0.15)
    assert bare.jackknife is None
    assert np.all(mode.fit_error > bare.fit_error)


def test_two_frfs_with_hits_are_known_better_than_one() -> None:
    sets = [tap(1), tap(2)]
    one, two = first_mode(sets[0]), fit_common_modes([estimate_frf(hits) for hits in sets], hits=sets)[0]
    assert two.fit_error[0] == pytest.approx(one.fit_error[0] / np.sqrt(2), rel=0.2)


def test_hits_of_a_single_frf_of_several_count_without_a_jackknife() -> None:
    sets = [tap(1), tap(2)]
    frfs = [estimate_frf(hits) for hits in sets]
    some, none = fit_common_modes(frfs, hits=[sets[0], []])[0], fit_common_modes(frfs)[0]
    assert some.jackknife is None
    assert some.fit_error[0] > none.fit_error[0]
    with pytest.raises(ValueError, match=r"1 .*hits .*2 FRFs"):
        fit_common_modes(frfs, hits=sets[:1])


def test_jackknife_is_that_of_refitted_frfs() -> None:
    hits = tap(1)
    mode = first_mode(hits)
    without = [values(fit_modes(estimate_frf(hits[:i] + hits[i + 1 :]))[0]) for i in range(10)]
    spread = np.array(without) - np.mean(without, axis=0)
    refitted = np.sqrt(0.9 * np.sum(spread**2, axis=0))
    assert mode.standard_error[1:] == pytest.approx(refitted[1:], rel=0.1)
    assert refitted[0] < mode.standard_error[0] < 2 * refitted[0]


@pytest.mark.parametrize(("hard", "gain"), [(1.0, 10.0), (2.0, 15.625)])
def test_noise_of_a_single_hit_is_above_that_of_the_mean_by_the_powers(hard: float, gain: float) -> None:
    """Ten equal hits: 10. Five of power 1 and five of power 4: 25 for the mean, 0.625 for the inverse."""
    softest = tap(1)[0]
    plain = replace(softest, force=softest.force - np.median(softest.force), codes=None)
    hits = [replace(plain, force=plain.force * k, acceleration=plain.acceleration * k) for k in [1.0, hard] * 5]
    frf = estimate_frf(hits)
    state = extract_modes([frf])
    found = jackknife_covariance(state, state.bands[0], 0, hits, leave_one_out_frfs(hits, frf))
    assert found.noise_gain == pytest.approx(gain, rel=1e-9)


@pytest.mark.parametrize("n_hits", [0, 1, 2])
def test_two_hits_have_no_jackknife(n_hits: int) -> None:
    hits = tap(0, 2)
    (mode, *_) = fit_modes(estimate_frf(hits), hits=hits[:n_hits])
    assert mode.jackknife is None
    assert mode.n_hits == 0
    assert mode.standard_error == pytest.approx(mode.fit_error)


@pytest.mark.parametrize("n_hits", [1, 3])
def test_hits_of_another_record_are_rejected(n_hits: int) -> None:
    hits = tap(0, n_hits)
    short = [Hit(hit.force[:4096], hit.acceleration[:4096], EMULATED_SAMPLE_RATE, PRE_TRIGGER) for hit in hits]
    with pytest.raises(ValueError, match=r"hits.*frequency lines"):
        fit_modes(estimate_frf(hits), hits=short)


@pytest.mark.parametrize("n_hits", [1, 2, 10])
def test_noise_of_the_hammer_is_seen_by_the_fit_where_the_hits_are_there(n_hits: int) -> None:
    tests = [tap(seed, n_hits, hammer_noise=0.5) for seed in range(30)]
    modes = [first_mode(hits) for hits in tests]
    scatter = np.std([values(mode) for mode in modes], axis=0)
    with_hits = np.sqrt(np.mean([mode.fit_error**2 for mode in modes], axis=0))
    alone = [fit_modes(estimate_frf(hits))[0].fit_error for hits in tests[:10]]
    assert with_hits == pytest.approx(scatter, rel=0.35)
    assert np.mean(alone, axis=0)[2] < scatter[2] / 2


def test_hits_see_the_noise_of_the_hammer() -> None:
    modes = [first_mode(tap(seed, hammer_noise=0.5, sensor_noise=0.2)) for seed in range(25)]
    over_hits = np.sqrt(np.mean([mode.standard_error**2 for mode in modes], axis=0))
    assert over_hits == pytest.approx(np.std([values(mode) for mode in modes], axis=0), rel=0.35)


def test_interval_is_students_over_hits_and_with_the_freedom_of_the_fit_without() -> None:
    cov = np.diag([4.0, 1e-8, 9e8])
    alone = Mode(1722.0, 0.03, 3.5e7, cov)
    of_few_lines = Mode(1722.0, 0.03, 3.5e7, cov, degrees_of_freedom=13)
    over_hits = Mode(1722.0, 0.03, 3.5e7, cov, jackknife=4 * cov, n_hits=10)
    assert alone.interval()[0] == pytest.approx(1722 + norm.ppf([0.025, 0.975]) * 2)
    assert of_few_lines.interval()[0] == pytest.approx(1722 + t.ppf([0.025, 0.975], 13) * 2)
    assert over_hits.interval(0.9)[2] == pytest.approx(3.5e7 + t.ppf([0.05, 0.95], 9) * 6e4)
    assert np.all(np.isnan(Mode(1722.0, 0.03, 3.5e7).interval()))
    with pytest.raises(ValueError, match=r"level=.* 0 and 1"):
        alone.interval(1.0)


def test_freedom_of_a_fit_is_twice_its_lines_less_unknowns() -> None:
    """One mode has three, four complex residual terms eight."""
    (mode,) = fit_modes(one_average([STRONG], np.linspace(1300.0, 1700.0, 12), 0.001, 0))
    assert mode.degrees_of_freedom == 2 * 12 - 3 - 8


def test_freedom_is_positive() -> None:
    with pytest.raises(ValueError, match="degrees_of_freedom=0"):
        Mode(1722.0, 0.03, 3.5e7, degrees_of_freedom=0)


def test_correlation_of_damping_and_stiffness_of_a_driving_point_is_negative() -> None:
    correlation = first_mode(tap(0)).correlation
    assert np.diag(correlation) == pytest.approx(1.0)
    assert correlation[1, 2] < -0.7
    assert np.all(np.isnan(Mode(1722.0, 0.03, 3.5e7).correlation))


def test_shape_of_a_covariance_and_hits_of_a_jackknife_are_checked() -> None:
    with pytest.raises(ValueError, match=r"jackknife .*\(2, 2\)"):
        Mode(1722.0, 0.03, 3.5e7, jackknife=np.eye(2), n_hits=10)
    with pytest.raises(ValueError, match="n_hits=0"):
        Mode(1722.0, 0.03, 3.5e7, jackknife=np.eye(3))


TESTS = 500


def share_held(modes: list[Mode], reach: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the modes whose f, zeta and K lie within reach of the truth, (3,)."""
    return np.asarray(np.mean(np.abs([values(mode) - TRUTH for mode in modes]) < reach, axis=0))


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("hammer_noise", [0.02, 0.1])
@pytest.mark.parametrize("n_hits", [1, 2, 10])
def test_95_percent_intervals_of_tap_tests_hold_the_truth(n_hits: int, hammer_noise: float) -> None:
    """Intervals of the fit for any number of hits, intervals over hits for ten."""
    modes = [first_mode(tap(1000 + seed, n_hits, hammer_noise)) for seed in range(TESTS)]
    of_fit = share_held(modes, np.array([t.ppf(0.975, mode.degrees_of_freedom) * mode.fit_error for mode in modes]))
    shown = share_held(modes, np.array([mode.quantile() * mode.standard_error for mode in modes]))
    print(f"{n_hits} hits, hammer noise {hammer_noise} N: of the fit {of_fit}, shown {shown}")  # noqa: T201
    for share in (of_fit, shown):
        assert np.all((share >= 0.92) & (share <= 0.98))


def correlation_of_neighbouring_lines(hits: list[Hit]) -> float:
    """Return the weighted correlation of the residual of the first mode's fit."""
    left = extract_modes([estimate_frf(hits)]).bands[0].fit.complex_residual[0]
    return float(np.real(np.vdot(left[:-1], left[1:])) / np.linalg.norm(left) ** 2)


@pytest.mark.long
@pytest.mark.timeout(600)
def test_what_a_fit_leaves_does_not_show_noise_of_the_hammer() -> None:
    """It is as white with that noise as without: what the noise adds to the covariance must come from the hits."""
    noises = (0.02, 0.1)
    each = [[correlation_of_neighbouring_lines(tap(s, hammer_noise=noise)) for s in range(200)] for noise in noises]
    without, with_noise = np.mean(each, axis=1)
    print(f"neighbouring lines: {without:.3f}, with noise of the hammer {with_noise:.3f}")  # noqa: T201
    assert abs(with_noise - without) < 0.01
    assert abs(with_noise) < 0.05


@pytest.mark.long
@pytest.mark.parametrize(
    ("modes", "lines", "level"),
    [
        ([STRONG], np.arange(5.0, 4000.0, 5.0), 0.002),
        ([STRONG, WEAK], np.arange(5.0, 4000.0, 5.0), 0.002),
        ([STRONG], np.linspace(1300.0, 1700.0, 12), 0.005),
        ([Mode(1500.0, 0.0005, 3e7)], np.arange(4.0, 4000.0, 4.0), 0.001),
    ],
    ids=["alone", "weak neighbour", "12 lines", "0.05 % at 4 Hz"],
)
def test_95_percent_interval_of_one_average_holds_the_truth(
    modes: list[Mode], lines: NDArray[np.float64], level: float
) -> None:
    truth = values(modes[0])[:, None]
    limits = np.array([fit_modes(one_average(modes, lines, level, seed))[0].interval() for seed in range(400)])
    share = np.mean((limits[:, :, :1] < truth) & (truth < limits[:, :, 1:]), axis=0)[:, 0]
    print(f"{len(modes)} modes, {lines.size} lines: {share}")  # noqa: T201
    assert np.all((share >= 0.92) & (share <= 0.98))
