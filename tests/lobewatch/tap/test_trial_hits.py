"""Trial hits: decay time, record length, trigger level and range."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from acquisition import Channel, Hit, HitFlags, estimate_decay_time
from lobewatch.machine.settings.setup_tables import TapTable
from lobewatch.tap.trial_hits import TrialHits, trigger_from_setup

pytestmark = pytest.mark.quick

RATE = 5120.0
Pair = tuple[Channel, Channel]


def hit(
    channels: Pair,
    tau: float = 0.05,
    peak: float = 200.0,
    seconds: float = 0.25,
    response: float = 500.0,
    second: float = 0.0,
) -> Hit:
    """Make a pulse with a mode at 60 Hz of this time constant, a faster one at 900 Hz, and noise."""
    random = np.random.default_rng(3)
    time = np.arange(round(seconds * RATE)) / RATE - 0.02
    force = peak * np.where(np.abs(time - 5e-4) < 1e-3, np.cos(np.pi * (time - 5e-4) / 2e-3) ** 2, 0.0)
    force += second * peak * np.where(np.abs(time - 0.02) < 1e-3, np.cos(np.pi * (time - 0.02) / 2e-3) ** 2, 0.0)
    since = np.maximum(time, 0)
    ringing = np.exp(-since / tau) * np.sin(2 * np.pi * 60 * since) + np.exp(-since / 0.003) * np.sin(5655 * since)
    signals = force + random.normal(scale=0.05, size=time.size), response * ringing + random.normal(size=time.size)
    codes = [channel.encode(signal) for channel, signal in zip(channels, signals, strict=True)]
    return Hit.from_codes(codes, channels, RATE, round(0.02 * RATE))


def baseline(channels: Pair, noise: float = 0.05) -> Hit:
    random = np.random.default_rng(4)
    codes = [channels[0].encode(random.normal(scale=noise, size=5120)), channels[1].encode(random.normal(size=5120))]
    return Hit.from_codes(codes, channels, RATE)


@pytest.mark.parametrize(("tau", "bound"), [(0.02, 0.1), (0.05, 0.1), (0.2, 0.15), (0.5, 0.25)])
def test_the_slowest_decay_is_found(channels: Pair, tau: float, bound: float) -> None:
    """Check that a decay longer than the record of 0.25 s is extrapolated, and refined by the next longer record."""
    assert estimate_decay_time(hit(channels, tau)) == pytest.approx(tau, rel=bound)


def test_what_does_not_ring_or_has_no_pulse(channels: Pair) -> None:
    assert estimate_decay_time(hit(channels, response=0.0)) == 0.0
    silent = np.zeros(1000)
    with pytest.raises(ValueError, match="pulse"):
        estimate_decay_time(Hit(silent, silent, RATE))


def test_what_machine_toml_sets_needs_no_trial() -> None:
    trigger = trigger_from_setup(TapTable(record_s=0.3, trigger_n=15.0), RATE)
    assert trigger is not None
    assert (trigger.level, trigger.n_samples, trigger.pre_trigger) == (15.0, 1536, 102)
    assert trigger_from_setup(TapTable(record_s=0.3), RATE) is None
    assert trigger_from_setup(TapTable(trigger_n=15.0), RATE) is None


def test_two_hits_choose_the_level_and_a_record_that_is_long_enough_stays(channels: Pair) -> None:
    trial = TrialHits(TapTable(), baseline(channels))
    assert trial.trigger.level == pytest.approx(0.005 * 5 / 2.25e-3, rel=0.01)
    assert "Trial hit 1" in trial.text
    for peak in (150.0, 250.0):
        assert not trial.is_done
        assert not trial.add(hit(channels, 0.03, peak))
    assert trial.is_done
    assert trial.trigger.n_samples == round(0.25 * RATE)
    assert trial.trigger.level == pytest.approx(20.0, rel=0.06)
    assert re.findall(r"\d[\d.]*", trial.text)[:3] == ["20", "0.25", "8"]


def test_a_slow_mode_makes_the_record_longer_and_asks_for_a_third_hit(channels: Pair) -> None:
    trial = TrialHits(TapTable(), baseline(channels))
    trial.add(hit(channels, 0.2))
    longer = trial.trigger.n_samples / RATE
    assert longer >= 6 * 0.2 * 0.85
    assert longer == pytest.approx(round(longer / 0.05) * 0.05)
    trial.add(hit(channels, 0.2, seconds=longer))
    assert not trial.is_done
    trial.add(hit(channels, 0.2, seconds=longer))
    assert trial.is_done


def test_a_set_value_stays(channels: Pair) -> None:
    slow = hit(channels, 0.2)
    fixed = TrialHits(TapTable(record_s=0.25), baseline(channels))
    fixed.add(slow)
    assert fixed.trigger.n_samples == slow.force.size
    level = TrialHits(TapTable(trigger_n=33.0), baseline(channels))
    level.add(slow)
    assert level.trigger.level == 33.0


def test_the_level_stays_clear_of_the_noise_and_below_the_hits(channels: Pair) -> None:
    noisy = TrialHits(TapTable(), baseline(channels, noise=3.0))
    assert noisy.trigger.level == pytest.approx(30.0, rel=0.05)
    for _ in range(2):
        noisy.add(hit(channels))
    assert noisy.trigger.level == pytest.approx(30.0, rel=0.05)
    louder = TrialHits(TapTable(), baseline(channels, noise=30.0))
    louder.add(hit(channels))
    assert louder.trigger.level == pytest.approx(100.0, rel=0.05)


def test_ranges_that_do_not_fit_are_reported_with_the_one_that_would(channels: Pair) -> None:
    soft = TrialHits(TapTable(), baseline(channels))
    for _ in range(2):
        soft.add(hit(channels, 0.03, peak=20.0))
    assert [(remark.code, remark.about) for remark in soft.remarks] == [("range-too-large", "force")]
    assert all(fact in soft.text for fact in ("force", "0.9 %", "2.22e+03 N", "40 N"))
    hard = TrialHits(TapTable(), baseline(channels))
    for _ in range(2):
        hard.add(hit(channels, 0.03, peak=2100.0))
    assert [(remark.code, remark.about) for remark in hard.remarks] == [("range-too-small", "force")]
    assert hard.remarks[0].cure in hard.text
    coarse = (channels[0], replace(channels[1], full_scale=500.0))
    weak = TrialHits(TapTable(), baseline(coarse))
    for _ in range(2):
        weak.add(hit(coarse, 0.03))
    assert [(remark.code, remark.about) for remark in weak.remarks] == [("range-too-large", "acceleration")]


def test_a_double_hit_is_no_trial_hit(channels: Pair) -> None:
    trial = TrialHits(TapTable(), baseline(channels))
    assert trial.add(hit(channels, 0.03, second=1.0)) & HitFlags.DOUBLE_HIT
    assert "Trial hit 1" in trial.text


@pytest.mark.parametrize("peaks", [(1e5, 1e5), (2100.0, 2100.0)])
def test_two_overloaded_hits_leave_the_low_level_of_the_first(channels: Pair, peaks: tuple[float, ...]) -> None:
    trial = TrialHits(TapTable(), baseline(channels))
    first = trial.trigger.level
    for peak in peaks:
        assert not trial.add(hit(channels, peak=peak))
    assert trial.trigger.level == first < 20.0
    assert "range-too-small" in [remark.code for remark in trial.remarks]


def test_the_hit_within_the_range_sets_the_level(channels: Pair) -> None:
    trial = TrialHits(TapTable(), baseline(channels))
    for peak in (1e5, 40.0):
        trial.add(hit(channels, peak=peak))
    assert trial.trigger.level == pytest.approx(0.1 * 40.0, rel=0.05)
