"""Frequency drop at speed: its range, its share of each mode, and verdicts and settings that hold over it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import msgspec
import numpy as np
import pytest

from acquisition import DataError
from dsm import Bearing, Segment, Spindle, calibrate, natural_frequencies
from lobes import program_limit
from lobewatch.machine import Machine, ProgramTable, SpeedTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.monte_carlo import MonteCarloResult, find_chattering_at_speed, run_monte_carlo
from lobewatch.verdicts.program_case import ProgramCase, SpindleAtSpeed, build_program
from lobewatch.verdicts.program_samples import draw_rotating_samples, find_worst_limit
from lobewatch.verdicts.recommendation import recommend
from lobewatch.verdicts.setting_robustness import (
    ROBUST_DEPTH_FACTOR,
    find_critical_drop,
    find_speed_window,
    sweep_neighborhood,
)
from lobewatch.verdicts.setting_search import SettingSearch
from lobewatch.verdicts.speed_drop import SpeedDrop, find_drop_shares
from lobewatch.verdicts.verdict import Stability, evaluate_program
from modal import Mode

MODE = Mode(900.0, 0.03, 2e7)


def machine(drop: str = "") -> Machine:
    return parse_machine_file(f'[machine]\nname = "m"\n[speed]\nlow_rpm = 3000\nhigh_rpm = 20000\n{drop}\n')


def tool(*modes: Mode) -> Assembly:
    x = list(modes or (MODE,))
    return Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "t", x, x, ("x", "y"), None, {}, False, ())


def cut(speed: float = 9000.0, depth: float = 1.0) -> ProgramTable:
    return ProgramTable(
        name="a",
        teeth=4,
        radial_depth_mm=20,
        tool_diameter_mm=20,
        direction="down",
        tangential_n_per_mm2=800,
        radial_n_per_mm2=240,
        speed_rpm=speed,
        depth_mm=depth,
        feed="x",
    )


def true_limit(speed: float, drop: float, *modes: Mode) -> float:
    """Limit (mm) with all frequencies lower by a drop, at constant modal mass."""
    lower = [Mode(m.frequency * (1 - drop), m.damping_ratio, m.stiffness * (1 - drop) ** 2) for m in modes or (MODE,)]
    return 1e3 * program_limit(build_program(cut(speed), machine()), lower, lower).limit


def result(speed: float, depth: float, drop: str) -> MonteCarloResult:
    return run_monte_carlo(ProgramCase(cut(speed, depth), tool(), machine(drop)))


def test_the_drop_counts_whole_from_a_quarter_of_the_highest_speed_and_in_proportion_below() -> None:
    table = SpeedTable(high_rpm=20000.0, drop_percent=(-2.0, 6.0))
    assert [table.drop_range(speed) for speed in (0.0, 2500.0, 5000.0, 20000.0)] == [
        (0.0, 0.0), (-0.01, 0.03), (-0.02, 0.06), (-0.02, 0.06)
    ]  # fmt: skip
    assert machine().speed.drop_percent == (0.0, 5.0)


@pytest.mark.parametrize("drop", ["[-5.1, 2]", "[0, 20.1]", "[3, 2]", "[1]", "5", '["a", 1]', "[nan, 1]", "[0, inf]"])
def test_a_drop_out_of_range_or_order_is_refused(drop: str) -> None:
    with pytest.raises(DataError, match="drop_percent"):
        machine(f"drop_percent = {drop}")


def test_modal_mass_and_damping_stay_and_the_samples_fill_the_range() -> None:
    samples = result(9000.0, 0.2, "drop_percent = [-1, 4]").samples
    turning, drops = samples.at_speed().rows, samples.drop.spread(301)
    assert turning.frequency == pytest.approx(samples.rows.frequency * (1 - drops[:, np.newaxis]))
    assert turning.stiffness / turning.frequency**2 == pytest.approx(samples.rows.stiffness / samples.rows.frequency**2)
    assert np.array_equal(turning.damping_ratio, samples.rows.damping_ratio)
    assert drops[0] == pytest.approx(0.04)
    assert np.max(np.diff(np.sort(drops))) < 3 * 0.05 / 300
    assert abs(np.corrcoef(drops[1:], samples.rows.tangential[1:])[0, 1]) < 0.15
    assert samples.drop.steps == pytest.approx(np.linspace(-0.01, 0.04, 11))
    assert SpeedDrop(0.05, 0.05).steps == pytest.approx([0.05])


def test_a_common_drop_is_a_faster_cut_in_a_softer_spindle() -> None:
    """Closed form: f times s at constant mass is the speed over s and the depth over s squared."""
    samples = result(9000.0, 0.2, "drop_percent = [4, 4]").samples
    same = samples.sweep(1 / 0.96).growth(1e-3 / 0.96**2)
    assert samples.at_speed().growth(1e-3) == pytest.approx(same, abs=1e-5)


def test_a_mode_drops_as_far_as_softer_bearings_let_it() -> None:
    """First order: d ln f is half the energy share of the bearings times d ln k."""
    spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    model = calibrate(spindle, 0.97 * natural_frequencies(spindle, 1)[0])
    known = natural_frequencies(model.spindle, 4)
    other = calibrate(model.spindle, known[3] * 0.999, mode=4)
    modes = [Mode(float(f), 0.03, 2e7) for f in (known[0], known[3], 0.5 * known[0])]
    shares = find_drop_shares(replace(tool(*modes), calibration=model))
    assert shares == pytest.approx(np.tile([1.0, other.energy_share / model.energy_share, 1.0], 2), abs=0.03)
    assert np.array_equal(find_drop_shares(tool(*modes)), np.ones(1))


def test_stable_holds_over_the_whole_drop_and_the_limit_at_speed_is_the_lowest() -> None:
    speed = 6750.0
    lowest = min(true_limit(speed, drop) for drop in np.linspace(0, 0.05, 11))
    depth = 1.15 * lowest
    found = evaluate_program(cut(speed, depth), tool(), machine())
    assert 1e3 * found.limit == pytest.approx(true_limit(speed, 0.0), rel=1e-3)
    assert 1e3 * found.limit_at_speed == pytest.approx(lowest, rel=0.005)
    assert (found.stability, found.decisive_cause) == (Stability.DOUBTFUL, "drop")
    assert "doubt-decides" in [remark.code for remark in found.remarks]
    still = evaluate_program(cut(speed, depth), tool(), machine("drop_percent = [0, 0]"))
    assert (still.stability, still.limit_at_speed) == (Stability.STABLE, still.limit)
    assert found.chatter_risk > still.chatter_risk


def test_lobes_between_the_ends_of_the_drop_count() -> None:
    """Both ends are in pockets 5 and 6, and a lobe lies between them."""
    spindle = tool(Mode(3600.0, 0.012, 6e7))

    def found(drop: str) -> MonteCarloResult:
        return run_monte_carlo(ProgramCase(cut(9000.0, 1.0), spindle, machine(f"drop_percent = {drop}")))

    assert found("[0, 0]").is_stable_throughout
    assert found("[16, 16]").is_stable_throughout
    between = found("[0, 16]")
    assert not between.is_stable_throughout
    assert between.limit_at_speed < 1e-3 < found("[16, 16]").limit_at_speed


def test_what_test_cuts_have_shown_does_not_drop_again() -> None:
    case = ProgramCase(cut(), tool(), machine(), SpindleAtSpeed(n_cuts=1))
    assert case.drop_at(9000.0).is_zero
    assert not replace(case, at_speed=SpindleAtSpeed()).drop_at(9000.0).is_zero


def test_chance_and_critical_drop_are_those_at_speed() -> None:
    samples = result(9000.0, 0.2, "drop_percent = [2, 6]").samples
    shares = draw_rotating_samples(samples).rows.frequency[1:] / samples.rows.frequency[1:]
    assert (np.min(shares), np.max(shares)) == pytest.approx((0.94, 0.98), abs=2e-4)
    low, high = (
        find_critical_drop(evaluate_program(cut(6750.0, 1.2), tool(), machine(f"drop_percent = [0, {most}]")))
        for most in (3, 0)
    )
    assert 0 < low.doubtful < high.doubtful
    assert low.not_stable == high.not_stable


def test_a_recommended_setting_is_stable_over_the_drop_and_ageing() -> None:
    modes = MODE, Mode(1500.0, 0.04, 6e7)
    answer = recommend(cut(), tool(*modes), machine(), SpindleAtSpeed())
    assert answer.setting is not None
    assert answer.verdict is not None
    setting = answer.setting
    limits = [true_limit(setting.speed_rpm, drop, *modes) for drop in np.linspace(0, 0.07, 15)]
    assert setting.depth_mm < min(limits)
    assert answer.verdict.chatter_risk == setting.chatter_risk
    free = recommend(cut(), tool(*modes), machine("drop_percent = [0, 0]"), SpindleAtSpeed()).setting
    assert free is not None
    assert free.speed_rpm * free.depth_mm > setting.speed_rpm * setting.depth_mm


def test_each_mode_drops_by_its_share_and_no_drop_is_always_among_the_ends() -> None:
    samples = run_monte_carlo(ProgramCase(cut(9000.0, 0.2), tool(MODE, Mode(1500.0, 0.04, 6e7)), machine())).samples
    shares = np.array([1.0, 2.0, 1.0, 2.0])
    turning = SpeedDrop(-0.01, 0.04, shares).apply(samples.rows, np.full(len(samples.rows), 0.04))
    assert turning.frequency / samples.rows.frequency == pytest.approx(np.tile([0.96, 0.92, 0.96, 0.92], (301, 1)))
    ends = [SpeedDrop(low, high, shares).ends for low, high in ((-0.01, 0.04), (-0.05, -0.02), (0.01, 0.02))]
    assert np.array(ends) == pytest.approx(np.array([(-0.02, 0.08), (-0.1, 0.0), (0.0, 0.04)]))
    assert SpeedDrop(-0.01, 0.04, shares).age(0.5) == pytest.approx((-0.02, 0.54))


def test_a_rise_counts_as_a_slower_speed_where_the_largest_drop_is_none() -> None:
    """Closed form: f times 1.05 at constant mass is the speed over 1.05."""
    samples = result(11000.0, 0.2, "drop_percent = [-5, 0]").samples
    slower = samples[np.zeros(1, dtype=np.intp)].sweep(np.linspace(1 / 1.05, 1.0, 21))
    largest = float(np.max(slower.growth(1e-3)))
    assert samples.median_growth_near(1e-3, samples.drop.ends)[0] >= largest - 1e-3
    assert samples.median_growth_near(1e-3)[0] < largest - 0.03


def test_a_neighborhood_is_aged_and_deeper_at_speed() -> None:
    samples = result(9000.0, 0.2, "drop_percent = [2, 4]").samples
    swept = sweep_neighborhood(samples, 0.1, lambda drop: 1 - drop).rows
    blocks = slice(None), np.arange(301)
    speed, frequency, stiffness, force = (
        (values.reshape(3, 301, -1) / known.reshape(301, -1))[blocks][..., 0]
        for values, known in (
            (swept.speed_rpm, samples.rows.speed_rpm),
            (swept.frequency, samples.rows.frequency),
            (swept.stiffness, samples.rows.stiffness),
            (swept.tangential, samples.rows.tangential),
        )
    )
    lower = 1 - samples.drop.spread(301)
    assert np.all(speed == 1)
    assert frequency == pytest.approx(np.array([0.9 * lower, 0.95 * lower, lower]))
    assert stiffness == pytest.approx(np.array([0.9, 0.95, 1])[:, np.newaxis] * lower**2)
    assert force == pytest.approx(np.tile([[1], [1], [ROBUST_DEPTH_FACTOR]], 301))


THIN_CUT = {"radial_depth_mm": 2, "feed": "both", "speed_rpm": 11000, "depth_mm": 6}
"""Another feed direction than that with the lowest limit not rotating is the first to chatter at speed."""
THIN_X, THIN_Y = [Mode(700.0, 0.03, 2e7), Mode(1500.0, 0.03, 4e7)], [Mode(900.0, 0.03, 2.5e7), Mode(1250.0, 0.04, 5e7)]


def thin_case(drop: str, share: float = 0.0) -> ProgramCase:
    """Thin cut of a spindle with all frequencies lower by a share."""
    x, y = (
        [Mode(m.frequency * (1 - share), m.damping_ratio, m.stiffness * (1 - share) ** 2) for m in modes]
        for modes in (THIN_X, THIN_Y)
    )
    table = msgspec.structs.replace(cut(), **THIN_CUT)
    return ProgramCase(table, replace(tool(), x=x, y=y), machine(f"drop_percent = {drop}"))


def test_another_feed_direction_may_chatter_first_at_speed() -> None:
    found = run_monte_carlo(thin_case("[0, 15]"))
    few = found.samples[np.arange(24)]
    grown = few.at_speed().growth_by_cut(6e-3)[..., 0]
    assert np.all(grown[0] < 0)
    assert np.any(grown >= 0)
    assert np.array_equal(find_chattering_at_speed(few, 6e-3), np.any(grown >= 0, axis=0))
    lowest = min(find_worst_limit(thin_case("[0, 0]", share)).limit.limit for share in np.linspace(0, 0.15, 31))
    assert found.limit_at_speed == pytest.approx(lowest, rel=0.01)
    assert found.limit_at_speed < 0.9 * found.median.limit


FURTHER_DROPS = [pytest.param(drop, marks=pytest.mark.long) for drop in ("[-5, 20]", "[20, 20]", "[0, 0]")]


@pytest.mark.parametrize("drop", ["[0, 5]", "[-5, -5]", *FURTHER_DROPS])
def test_a_recommended_setting_has_a_speed_margin_of_1_percent(drop: str) -> None:
    mill, spindle = machine(f"drop_percent = {drop}"), tool(MODE, Mode(1500.0, 0.04, 6e7))
    setting = recommend(cut(), spindle, mill, SpindleAtSpeed()).setting
    assert setting is not None
    for speed in (0.99 * setting.speed_rpm, 1.01 * setting.speed_rpm, *setting.window_rpm):
        beside = evaluate_program(cut(min(speed, 20000.0), setting.depth_mm), spindle, mill)
        assert (speed, beside.stability) == (speed, Stability.STABLE)


def test_the_end_of_a_window_is_found_at_speed_to_a_step() -> None:
    """Samples without force bound nothing, so that all others decide."""
    mill = machine()
    search = SettingSearch(ProgramCase(cut(), tool(), mill))
    best = search.best
    assert best is not None
    near = search.results[best.speed_rpm, best.depth_mm].samples
    calm = near[np.arange(2)].sweep(1.0, force=1e-3)
    slow, fast = find_speed_window(near, calm, best.speed_rpm, best.depth_mm / 1e3, search.cut_range)
    still = replace(near, drop=SpeedDrop())
    assert fast <= find_speed_window(still, calm, best.speed_rpm, best.depth_mm / 1e3, search.cut_range)[1]
    assert slow <= 0.99 * best.speed_rpm + 10
    for speed, is_stable in ((slow, True), (fast, True), (slow / 1.011, False), (fast * 1.011, False)):
        found = evaluate_program(cut(speed, best.depth_mm), tool(), mill)
        assert (speed, found.stability is Stability.STABLE) == (speed, is_stable)
