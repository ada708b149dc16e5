"""Verdicts on cuts made of sines: spindle harmonics, air, chatter, and cases without a verdict."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording, group_peaks

Floats = NDArray[np.float64]
RATE = 25600.0
SPEED = 12077.0
"""The true one (rpm)."""
SET = 12000.0
"""Commanded speed (rpm)."""
TURN = SPEED / 60
FOREIGN = ((3333.3, 2.0), (717.0, 1.0), (100.0, 0.5))
AIR, CUT, AFTER = 0.5, 1.2, 0.3
"""s."""


def sines(lines: Any, n: int, random: np.random.Generator) -> Floats:
    """Lines (Hz, m/s^2) sampled without a filter: lines above half the sample rate are aliased."""
    time = np.arange(n) / RATE
    signal = np.zeros(n)
    for frequency, amplitude in lines:
        signal += amplitude * np.sin(2 * np.pi * frequency * time + random.uniform(0, 2 * np.pi))
    return signal


def comb(teeth: int, run_out: float = 0.2, highest: float = 40e3) -> list[tuple[float, float]]:
    """Tooth passing and its multiples, falling with frequency, with side bands of an eccentric tool."""
    lines = []
    for k in range(1, int(highest / TURN)):
        beside = k % teeth in (1, teeth - 1)
        share = 1.0 if k % teeth == 0 else run_out if beside else 0.0
        lines.append((k * TURN, 30.0 * share / (1 + k * TURN / 4000.0)))
    return lines


def recorded(cut: Floats, seed: int = 0, foreign: Any = FOREIGN) -> Floats:
    """Air, the cut, air."""
    random = np.random.default_rng(seed)
    n = round((AIR + CUT + AFTER) * RATE)
    signal = sines((*foreign, (TURN, 0.8)), n, random) + random.normal(scale=0.05, size=n)
    begin = round(AIR * RATE)
    signal[begin : begin + cut.size] += cut
    return signal


def a_cut(teeth: int = 4, chatter: float | None = None, loud: float = 20.0, **options: Any) -> Floats:
    """chatter: f_c (Hz) with side bands k tooth passing."""
    random, lines = np.random.default_rng(1), comb(teeth, **options)
    if chatter is not None:
        sides = [(abs(chatter + k * teeth * TURN), loud * (0.3 if k > 0 else 0.05) ** abs(k)) for k in range(-3, 4)]
        lines += sides
    return sines(lines, round(CUT * RATE), random)


def listen(signal: Floats, teeth: int = 4, **options: Any) -> CutEvaluation:
    (heard,) = evaluate_recording(CutRecording(signal, RATE, teeth, 0.5, SET, **options))
    return heard


def test_a_quiet_cut_is_stable_and_its_speed_is_found() -> None:
    heard = listen(recorded(a_cut()))
    assert (heard.verdict, heard.reason, heard.chatter) == ("stable", "", None)
    assert heard.speed_rpm == pytest.approx(SPEED, rel=2e-5)
    assert heard.parts.begin == pytest.approx(AIR, abs=0.03)
    assert heard.parts.end == pytest.approx(AIR + CUT, abs=0.03)
    assert heard.spindle_speed is not None
    assert abs(heard.speed_rpm - SPEED) / 60 < 5 * heard.spindle_speed.error


@pytest.mark.parametrize("off", [-0.045, -0.019, 0.019, 0.045])
def test_a_speed_up_to_five_percent_next_to_the_one_that_was_set_is_found(off: float) -> None:
    (heard,) = evaluate_recording(CutRecording(recorded(a_cut()), RATE, 4, 0.5, SPEED / (1 + off)))
    assert heard.speed_rpm == pytest.approx(SPEED, rel=2e-5)


def test_chatter_is_reported_with_its_frequency_and_its_side_bands() -> None:
    heard = listen(recorded(a_cut(chatter=1712.3)))
    assert heard.verdict == "chatter"
    assert heard.chatter is not None
    assert heard.chatter.frequency == pytest.approx(1712.3, abs=0.1)
    tooth = 4 * TURN
    frequency = heard.chatter.peaks.frequency
    for k in (-1, 0, 1, 2):
        assert np.min(np.abs(frequency - (1712.3 + k * tooth))) < 0.3
    assert heard.energy_ratio > 0.1
    assert heard.speed_rpm == pytest.approx(SPEED, rel=2e-5)


def test_chatter_without_a_tooth_passing_that_is_detected_spaces_its_side_bands_by_the_spindle() -> None:
    lines = [(1712.3 + k * TURN, 20.0 * 0.6 ** abs(k)) for k in range(-8, 9)]
    heard = listen(recorded(sines(lines, round(CUT * RATE), np.random.default_rng(2))))
    assert heard.verdict == "chatter"
    assert heard.speed_rpm == pytest.approx(SPEED, rel=1e-4)


def test_period_two_is_reported_where_teeth_are_odd_and_not_where_they_are_even() -> None:
    odd = listen(recorded(a_cut(3, chatter=1.5 * 3 * TURN)), 3)
    assert odd.verdict == "flip"
    assert odd.chatter is not None
    assert odd.chatter.frequency / (3 * TURN) % 1 == pytest.approx(0.5, abs=1e-3)
    even = listen(recorded(a_cut(4, chatter=1.5 * 4 * TURN, loud=60.0)), 4)
    assert (even.verdict, even.reason) == ("cannot tell", "on-spindle-lines")


def test_what_was_there_before_is_no_chatter() -> None:
    foreign = [(f, 6.0) for f in (1711.0, 2305.5, 4444.4)]
    assert listen(recorded(a_cut(), foreign=foreign)).verdict == "stable"
    only = sines(foreign, round(CUT * RATE), np.random.default_rng(3))
    assert listen(recorded(a_cut() + only, foreign=())).verdict != "stable"


def test_multiples_above_half_the_sample_rate_are_no_chatter() -> None:
    far = [(k * TURN, 1.5) for k in range(132, 250, 4)]
    assert min(f for f, _ in far) > RATE
    random = np.random.default_rng(4)
    heard = listen(recorded(a_cut(highest=12e3) + sines(far, round(CUT * RATE), random)))
    assert heard.verdict == "stable"


def test_a_mode_that_rings_down_is_no_chatter() -> None:
    time = np.arange(round(CUT * RATE)) / RATE
    ringing = 20.0 * np.exp(-time / 0.12) * np.sin(2 * np.pi * 1712.3 * time)
    assert listen(recorded(a_cut() + ringing)).verdict == "stable"


@pytest.mark.parametrize(("chatter", "word"), [(None, "stable"), (1712.3, "chatter")])
def test_a_spindle_whose_speed_wavers_is_no_chatter_and_hides_none(chatter: float | None, word: str) -> None:
    random, time = np.random.default_rng(6), np.arange(round(CUT * RATE)) / RATE
    turned = 2 * np.pi * TURN * np.cumsum(1 + 3e-4 * np.sin(2 * np.pi * 1.3 * time)) / RATE
    cut = np.zeros(time.size)
    for k in range(1, 14):
        cut += 20 / k * np.sin(4 * k * turned + random.uniform(0, 6))
        cut += 3 / k * np.sin((4 * k + 1) * turned + random.uniform(0, 6))
    if chatter is not None:
        for k in range(4):
            cut += 10 * 0.3**k * np.sin(2 * np.pi * chatter * time + 4 * k * turned)
    assert listen(recorded(cut)).verdict == word


def test_the_spindle_in_air_is_no_cut() -> None:
    assert listen(recorded(np.zeros(round(CUT * RATE)))).reason == "no-cut"


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_pump_that_is_switched_on_is_no_chatter(count: int) -> None:
    random = np.random.default_rng(count)
    pump = sines([(f, 3.0) for f in random.uniform(200, 6000, count)], round(CUT * RATE), random)
    assert listen(recorded(pump)).reason == "speed-not-found"


def test_a_speed_far_from_the_one_that_was_set_is_not_found() -> None:
    (heard,) = evaluate_recording(CutRecording(recorded(a_cut()), RATE, 4, 0.5, SPEED * 1.08))
    assert (heard.verdict, heard.reason) == ("cannot tell", "speed-not-found")


@pytest.mark.parametrize("wrong", [0.6, 0.76, 0.9, 1.08, 1.327, 1.9])
def test_a_clear_comb_far_from_the_speed_that_was_set_is_named_and_not_followed(wrong: float) -> None:
    (heard,) = evaluate_recording(CutRecording(recorded(a_cut()), RATE, 4, 0.5, wrong * SPEED))
    assert (heard.reason, heard.spindle_speed) == ("speed-not-found", None)
    assert heard.distant_rpm == pytest.approx(SPEED, rel=1e-3)


def test_pumps_name_no_speed() -> None:
    random = np.random.default_rng(12)
    pump = sines([(f, 3.0) for f in random.uniform(200, 6000, 6)], round(CUT * RATE), random)
    assert np.isnan(listen(recorded(pump)).distant_rpm)


def test_a_tenth_of_a_second_is_too_short() -> None:
    assert listen(recorded(a_cut())[: round(0.1 * RATE)]).reason == "too-short"
    assert listen(recorded(a_cut()[: round(0.35 * RATE)])).reason == "too-short"


def test_several_cuts_in_one_recording_are_reported_each() -> None:
    signal = np.concatenate([recorded(a_cut()), recorded(a_cut(chatter=1712.3))])
    first, second = evaluate_recording(CutRecording(signal, RATE, 4, 0.5, SET))
    assert (first.verdict, second.verdict) == ("stable", "chatter")
    assert first.parts.begin == pytest.approx(AIR, abs=0.03)
    assert second.parts.begin == pytest.approx(AIR + CUT + AFTER + AIR, abs=0.03)


@pytest.mark.parametrize("chatters", [0, 1, 2])
def test_several_axes_have_one_speed_and_the_verdict_of_the_one_that_detects_chatter(chatters: int) -> None:
    axes = [recorded(0.3 * a_cut(chatter=1712.3 if axis == chatters else None), seed=axis) for axis in range(3)]
    (heard,) = evaluate_recording(CutRecording(np.stack(axes), RATE, 4, 0.5, SET))
    assert (heard.verdict, heard.axis) == ("chatter", chatters)
    assert heard.speed_rpm == pytest.approx(SPEED, rel=2e-5)


def test_a_cut_without_air_is_rejected() -> None:
    cut = recorded(a_cut())[round((AIR - 0.04) * RATE) : round((AIR + CUT) * RATE)]
    assert listen(cut).reason in ("no-air", "no-cut")


def test_a_hammer_in_the_cut_is_reported_and_one_next_to_it_does_no_harm() -> None:
    time = np.arange(round(0.05 * RATE)) / RATE
    hit = 900.0 * np.exp(-time / 0.004) * np.sin(2 * np.pi * 1700.0 * time)
    for at, reason in ((AIR + 0.6, "knock"), (0.1, "")):
        signal = recorded(a_cut())
        signal[round(at * RATE) :][: hit.size] += hit
        assert listen(signal).reason == reason


def test_an_overload_in_the_cut_and_lost_scans_are_reported() -> None:
    signal = recorded(a_cut())
    clipped = np.abs(signal) > 0.9 * np.max(signal)
    assert listen(signal, clipped=clipped).reason == "overload"
    assert listen(signal, clipped=np.arange(signal.size) < 10).reason == ""
    assert listen(signal, lost_scans=7).reason == "lost-scans"


COMB = ((4 * TURN, 30.0), (8 * TURN, 20.0), (12 * TURN, 10.0), (5 * TURN, 3.0), (9 * TURN, 2.0))
"""Multiples of a cutter of four teeth with a little run-out."""
ENERGY = sum(loud**2 for _, loud in COMB)


def heard_beside(*shares: float, frequency: float = 1712.3, teeth: int = 4) -> CutEvaluation:
    """Comb and f_c + k tooth passing, with these shares of the energy of the comb."""
    beside = [(frequency + k * teeth * TURN, np.sqrt(share * ENERGY)) for k, share in enumerate(shares)]
    return listen(recorded(sines((*COMB, *beside), round(CUT * RATE), np.random.default_rng(8))), teeth)


@pytest.mark.parametrize(("share", "word"), [(1.5e-4, "stable"), (2.5e-4, "cannot tell"), (0.009, "cannot tell")])
def test_a_line_alone_is_faint_between_2e_4_and_1e_2_of_the_comb(share: float, word: str) -> None:
    heard = heard_beside(share)
    assert (heard.verdict, heard.reason) == (word, "faint" if word == "cannot tell" else "")
    assert heard.energy_ratio == pytest.approx(share, rel=0.05)


@pytest.mark.parametrize(("shares", "word"), [
    ((0.004, 0.007), "chatter"), ((0.0045, 0.0045), "cannot tell"), ((0.0015, 0.0015, 0.0015), "chatter"),
    ((2e-4, 1.2e-4, 1.2e-4), "cannot tell"), ((2.5e-4, 1.5e-4, 1.5e-4), "chatter"),
])  # fmt: skip
def test_chatter_is_a_hundredth_of_the_comb_or_with_side_bands_a_twentieth_of_that(
    shares: tuple[float, ...], word: str
) -> None:
    heard = heard_beside(*shares)
    assert heard.verdict == word
    assert heard.energy_ratio == pytest.approx(sum(shares), rel=0.05)


def test_a_tone_without_side_bands_is_unexplained_and_one_with_a_side_band_a_turn_away_is_chatter() -> None:
    alone = heard_beside(0.02)
    assert (alone.verdict, alone.reason) == ("cannot tell", "unexplained-tone")
    assert alone.tone == pytest.approx(1712.3, abs=0.1)
    beside = [(1712.3, 8.0), (1712.3 + TURN, 2.0)]
    assert listen(recorded(sines((*COMB, *beside), round(CUT * RATE), np.random.default_rng(8)))).verdict == "chatter"


def test_what_stands_on_the_slope_of_tooth_passing_is_no_chatter() -> None:
    """5 and 7 bins away, a hundredth of its power, side bands of tooth passing apart, as where the load swells."""
    slopes = [(place * TURN + away, 3.0) for place in (4, 8, 12) for away in (-4.4, 6.3)]
    heard = listen(
        recorded(sines((*COMB[:2], (12 * TURN, 20.0), *slopes), round(CUT * RATE), np.random.default_rng(8)))
    )
    assert heard.verdict == "stable"


def slow(orders: Any, rate: float = 1650.0) -> CutEvaluation:
    """Simulate a cut of three teeth at 12 077 rpm, as a slow sensor without a filter records it."""
    random, size = np.random.default_rng(4), round(5.0 * rate)
    time = np.arange(size) / rate
    signal = random.normal(scale=0.02, size=size)
    for order, loud in orders:
        signal += np.where((time > 1.0) & (time < 4.0), loud * np.sin(2 * np.pi * order * TURN * time + order), 0.0)
    (heard,) = evaluate_recording(CutRecording(signal, rate, 3, 1.0, SET))
    return heard


def test_tooth_passing_that_a_slow_sensor_folds_back_is_no_chatter() -> None:
    """604 Hz is in band; 1208, 1812 and 2415 Hz alias to 442, 162 and 765 Hz."""
    heard = slow([(3, 5.0), (6, 2.0), (9, 12.0), (12, 0.5), (1, 0.1), (2, 0.3)])
    assert heard.verdict == "stable"
    assert heard.speed_rpm == pytest.approx(SPEED, rel=1e-3)


def test_with_fewer_than_three_harmonics_of_the_teeth_a_slow_sensor_tells_nothing() -> None:
    heard = slow([(3, 5.0), (1, 0.2), (2, 0.5), (4, 0.3)])
    assert (heard.verdict, heard.reason) == ("cannot tell", "slow-sampling")


def test_chatter_that_falls_counts_as_at_the_end_of_the_cut() -> None:
    """A tenth of its amplitude in the second half; the half of the whole line that the first half leaves."""
    time = np.arange(round(CUT * RATE)) / RATE
    falling = np.where(time < 0.6 * CUT, 1.0, 0.1) * 8.0 * np.sin(2 * np.pi * 1712.3 * time)
    heard = listen(recorded(sines(COMB, time.size, np.random.default_rng(8)) + falling))
    constant = heard_beside(64.0 / ENERGY)
    assert heard.energy_ratio < 0.1 * constant.energy_ratio


@pytest.mark.parametrize(("off", "word"), [(0.002, "flip"), (-0.002, "flip"), (0.004, "chatter"), (-0.004, "chatter")])
def test_period_two_is_within_3_thousandths_of_half_of_tooth_passing(off: float, word: str) -> None:
    lines = [*comb(3), *(((k + 0.5 + off) * 3 * TURN, 20.0 * 0.5**k) for k in range(4))]
    assert listen(recorded(sines(lines, round(CUT * RATE), np.random.default_rng(1))), 3).verdict == word


def without_chatter(teeth: int, immersion: float, *pairs: tuple[int, float]) -> tuple[str, str]:
    """Word on orders of the spindle with these energies."""
    lines = [(order * TURN, 10 * np.sqrt(energy)) for order, energy in pairs]
    signal = recorded(sines(lines, round(CUT * RATE), np.random.default_rng(9)))
    (heard,) = evaluate_recording(CutRecording(signal, RATE, teeth, immersion, SET))
    return heard.verdict, heard.reason


ON_LINES = "cannot tell", "on-spindle-lines"


@pytest.mark.parametrize(("energy", "words"), [(4.6, ("stable", "")), (5.4, ON_LINES)])
@pytest.mark.parametrize("order", [7, 8])
def test_orders_that_run_out_hardly_has_are_chatter_on_the_lines_of_the_spindle(
    energy: float, words: tuple[str, str], order: int
) -> None:
    """Orders 2 and 3 modulo five teeth, over 1 and 4."""
    assert without_chatter(5, 0.5, (5, 9.0), (10, 9.0), (15, 9.0), (6, 0.4), (9, 0.6), (order, energy)) == words


@pytest.mark.parametrize(("energy", "immersion", "words"), [
    (7.4, 0.5, ("stable", "")), (8.6, 0.5, ON_LINES), (8.6, 0.94, ON_LINES), (8.6, 0.96, ("stable", "")),
])  # fmt: skip
def test_run_out_is_no_louder_than_eight_times_tooth_passing_but_in_a_slot(
    energy: float, immersion: float, words: tuple[str, str]
) -> None:
    share = energy / 2
    assert without_chatter(5, immersion, (5, 0.4), (10, 0.4), (15, 0.2), (6, share), (9, share)) == words


def test_lines_are_drawn_by_what_they_are() -> None:
    kinds = group_peaks(listen(recorded(a_cut(chatter=1712.3))))
    assert set(kinds) == {"turns", "tooth", "air", "chatter"}
    tooth = kinds["tooth"].frequency / (4 * TURN)
    assert tooth == pytest.approx(np.round(tooth), abs=1e-3)
    turns = kinds["turns"].frequency / TURN
    assert turns == pytest.approx(np.round(turns), abs=1e-2)
    assert not np.any(np.round(turns) % 4 == 0)
    assert np.min(np.abs(kinds["air"].frequency - 3333.3)) < 0.1
    assert set(group_peaks(listen(recorded(a_cut())))) == {"turns", "tooth", "air"}
    assert group_peaks(listen(recorded(np.zeros(round(CUT * RATE))))) == {}


@pytest.mark.parametrize(("rate", "change"), [(5.0, 1e-3), (7.0, 1.5e-3), (9.0, 1e-3)])
def test_a_speed_that_wavers_several_times_a_second_is_no_chatter(rate: float, change: float) -> None:
    """Its high multiples are several faint lines, which lie a tooth passing or a turn apart."""
    time = np.arange(round(CUT * RATE)) / RATE
    turns = TURN * (time + change * np.sin(2 * np.pi * rate * time) / (2 * np.pi * rate))
    loud = {4 * k: 20.0 / k for k in range(1, 5)} | {36: 1.0, 39: 0.7, 40: 2.5, 41: 0.7, 44: 1.0}
    cut = np.sum([a * np.sin(2 * np.pi * order * turns + order) for order, a in loud.items()], axis=0)
    assert listen(recorded(cut)).verdict == "stable"


def test_loud_lines_near_multiples_are_chatter_all_the_same() -> None:
    """0.1 % off the 28th, with the energy of the comb: an unsteady speed never leaves such faint multiples."""
    heard = listen(recorded(a_cut(chatter=28.03 * TURN, loud=30.0)))
    assert heard.verdict == "chatter"
    assert heard.chatter is not None


def test_a_load_that_steps_is_no_chatter() -> None:
    """Steps at 24 Hz make all its multiples, which a mode at 2400 Hz amplifies."""
    steps = [(24.0 * m, 8.0 / m + 6.0 / (1 + (m - 100) ** 2 / 9)) for m in range(1, 150)]
    signal = recorded(a_cut(6) + sines(steps, round(CUT * RATE), np.random.default_rng(3)))
    assert listen(signal, 6).verdict == "stable"
