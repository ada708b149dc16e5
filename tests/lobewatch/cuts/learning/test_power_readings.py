"""Powers of normal production: a day counts once, a program is one piece of evidence, odd readings raise a question."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from lobewatch.cuts.learning.cut_likelihood import CutEvidence, PowerEvidence, estimate_force_by_power
from lobewatch.cuts.learning.drive_gain import power_log_likelihood
from lobewatch.cuts.learning.posterior import Contradiction, inconsistent_cut_remarks
from lobewatch.cuts.learning.power_readings import find_reading_remarks, merge_readings
from lobewatch.cuts.learning.program_learning import learn_program
from lobewatch.machine.folder_updates import make_observed_cut
from lobewatch.machine.journal.entries import CutEntry, CutVerdict, parse_cut_line
from lobewatch.machine.settings.machine_file import Machine, parse_machine_file
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.tool.assembly import Assembly
from modal import Mode
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

START = datetime(2026, 5, 4, 6, tzinfo=UTC)
PROGRAM = """
[[program]]
name = "{name}"
teeth = 4
tool_diameter_mm = 12
radial_depth_mm = 12
feed_per_tooth_mm = 0.08
direction = "down"
tangential_n_per_mm2 = 2000
radial_n_per_mm2 = 600
speed_rpm = 6000
depth_mm = {depth}
"""


@pytest.fixture(scope="module")
def machine() -> Machine:
    """With three slots that differ in depth."""
    programs = (PROGRAM.format(name=name, depth=depth) for name, depth in (("A", 1.0), ("B", 1.7), ("C", 4.0)))
    return parse_machine_file('[machine]\nname = "m"\n[speed]\nlow_rpm = 2000\nhigh_rpm = 9000\n' + "".join(programs))


def reading(machine: Machine, kilowatts: float, day: float = 0.0, program: str = "A", **fields: Any) -> CutEntry:
    setting = find_cut_setting(machine, program, None, None, kilowatts)
    entry = make_observed_cut(setting, "cannot tell", None, START + timedelta(days=day))
    return replace(entry, id=f"c{day:g}", **fields)


def expected_kilowatts(machine: Machine, program: str = "A") -> float:
    power = find_cut_setting(machine, program, None, None, 1.0).power
    assert power is not None
    return power.expected_power(6000.0) / 1e3


def codes(machine: Machine, entry: CutEntry, *earlier: CutEntry) -> list[str]:
    return [remark.code for remark in find_reading_remarks(entry, machine, earlier)]


def test_a_reading_has_no_verdict_and_survives_the_journal(machine: Machine) -> None:
    entry = reading(machine, 1.0)
    assert (entry.is_usable, entry.is_power_reading, entry.is_evidence, entry.has_chatter) == (False, True, True, False)
    assert parse_cut_line(entry.line) == entry
    assert not parse_cut_line(entry.line, excluded="wrong").is_evidence


def test_many_readings_of_one_program_and_day_count_as_one(machine: Machine) -> None:
    one = merge_readings([reading(machine, 1.1)])
    many = merge_readings([reading(machine, 1.1, hour / 48) for hour in range(20)])
    assert [days for _, days in one] == [days for _, days in many] == [1]
    assert one[0][0].power == many[0][0].power


def test_a_busy_day_outweighs_no_other_day_and_one_wrong_reading_moves_nothing(machine: Machine) -> None:
    days = [reading(machine, 1.0, 0.01 * k) for k in range(9)]
    days += [reading(machine, power, day) for day, power in ((1, 1.2), (3, 1.2), (2, 1.9))]
    ((merged, count),) = merge_readings(days)
    assert merged.power is not None
    assert (merged.id, count) == ("c3", 4)
    assert merged.power.tangential == pytest.approx(reading(machine, 1.2).power.tangential)  # type: ignore[union-attr]


def test_each_program_is_one_piece_of_evidence_and_days_make_its_own_error_smaller(machine: Machine) -> None:
    merged = merge_readings([reading(machine, 1.0, day, name) for day in range(4) for name in ("A", "B")])
    assert sorted((entry.program, days) for entry, days in merged) == [("A", 4), ("B", 4)]
    entry, days = merged[0]
    assert entry.power is not None
    one, four = (estimate_force_by_power(entry.power, entry.cut, chatters=False, days=count) for count in (1, days))
    assert four.own_error == pytest.approx(one.own_error / 2)
    assert four.common_error == one.common_error


def test_a_reading_teaches_kt_and_nothing_else(mill: Mill) -> None:
    read = CutEvidence(SLOT, 12000, 2e-3, "cannot tell", power=PowerEvidence(0.8, 0.15, 0.05))
    learnt = mill.prior.learn_from(read)
    before, after = mill.prior.intervals, learnt.intervals
    assert after["tangential"].std < 0.6 * before["tangential"].std
    assert abs(after["tangential"].mean - 0.8) < 0.12
    for name in ("ratio", "damping_x", "stiffness_y"):
        assert after[name].mean == pytest.approx(before[name].mean, rel=0.05)


@pytest.mark.parametrize(("verdict", "depth"), [("stable", 2.5e-3), ("chatter", 4e-3)])
def test_a_reading_at_the_place_of_a_cut_is_no_verdict_on_it(mill: Mill, verdict: CutVerdict, depth: float) -> None:
    made = CutEvidence(SLOT, 12000, depth, verdict, 1700.0 if verdict == "chatter" else float("nan"))
    read = replace(made, verdict="cannot tell", frequency=float("nan"), power=PowerEvidence(1.1, 1e3, 1e3))
    alone, both = mill.prior.learn_from(made), mill.prior.learn_from(read).learn_from(made)
    assert both.log_weight - alone.log_weight == pytest.approx(np.zeros(len(alone.samples)), abs=0.01)


def test_the_gain_is_common_to_all_materials(mill: Mill) -> None:
    """A reading that is far too high in one material makes one in another worth less."""
    first = CutEvidence(SLOT, 12000, 1e-3, "cannot tell", power=PowerEvidence(3.0, 0.15, 0.05))
    second = CutEvidence(SLOT, 12000, 1e-3, "cannot tell", material=1, power=PowerEvidence(3.0, 0.15, 0.05))
    samples = mill.prior.samples.with_materials(2, 0)
    alone, after = power_log_likelihood(second, samples, []), power_log_likelihood(second, samples, [first])
    usual = np.argmin(np.abs(samples.force_factors(0) - 1) + np.abs(samples.force_factors(1) - 1))
    assert after[usual] > alone[usual] + 1
    assert np.all(after <= 1e-9)


@pytest.mark.parametrize(("shown", "is_doubted"), [(1.0, False), (1.3, True)])
def test_a_wrong_gain_is_estimated_and_doubted_by_name(mill: Mill, shown: float, is_doubted: bool) -> None:
    mill.force = 1.1
    chatter = [mill.chatter(speed) for speed in (5300.0, 6900.0, 9000.0, 11000.0, 13000.0)]
    made = [*chatter, *(mill.hear(cut.speed_rpm, 0.82 * cut.depth) for cut in chatter)]
    learnt = mill.learnt_from([replace(cut, power=PowerEvidence(1.1 * shown, 0.15, 0.05)) for cut in made])
    gain = learnt.drive_gain
    assert gain is not None
    assert gain.low < shown < gain.high
    assert [remark.code for remark in inconsistent_cut_remarks(learnt, (), "A")].count("drive-gain") == is_doubted
    assert mill.prior.drive_gain is None


def test_a_drive_that_shows_twice_the_power_does_not_hide_the_kt_that_cuts_tell(mill: Mill) -> None:
    """One drive in fifty has a wrong gain: by the error of usual drives only, the interval would be above 1.25."""
    mill.force = 1.1
    chatter = [mill.chatter(speed) for speed in (6900.0, 9000.0, 13000.0)]
    made = [*chatter, *(mill.hear(cut.speed_rpm, 0.82 * cut.depth) for cut in chatter)]
    learnt = mill.learnt_from([replace(cut, power=PowerEvidence(2.4, 0.15, 0.05)) for cut in made])
    assert learnt.intervals["tangential"].low < mill.force


def test_powers_of_another_program_of_another_day_and_of_another_material_are_asked_about(machine: Machine) -> None:
    usual = expected_kilowatts(machine)
    earlier = [reading(machine, usual, day) for day in range(3)]
    assert codes(machine, reading(machine, usual, 4), *earlier) == []
    assert codes(machine, reading(machine, 1.7 * usual, 4), *earlier) == ["power-of-other-program"]
    assert codes(machine, reading(machine, 1.4 * usual, 4), *earlier) == ["power-changed"]
    assert codes(machine, reading(machine, 0.5 * usual, 4), *earlier) == ["power-changed", "material-contradicted"]
    assert codes(machine, reading(machine, 2.3 * usual)) == ["material-contradicted"]
    assert codes(machine, reading(machine, 1.4 * usual)) == []
    asked = "material-contradicted"
    assert asked not in codes(machine, reading(machine, 0.52 * usual))
    for share, is_asked in ((1.9, True), (0.47, False)):
        assert codes(machine, replace(reading(machine, share * usual), word="chatter")).count(asked) == is_asked


@pytest.mark.parametrize("share", [0.45, 0.8, 2.2])
def test_a_reading_off_by_two_is_asked_about_and_never_makes_kt_smaller(machine: Machine, share: float) -> None:
    x, y = [Mode(1713.0, 0.029, 3.5e7)], [Mode(1400.0, 0.035, 2.5e7)]
    tool = Assembly("reference", START, "drawn", x, y, ("x", "y"), None, {}, False, ())
    entry = reading(machine, share * expected_kilowatts(machine))
    found = learn_program(machine.program[0], tool, machine, [entry])
    before, after = (one.intervals["tangential"].mean for one in (found.prior, found.posterior))
    assert [odd.contradiction for odd in found.inconsistent_cuts] == [Contradiction.MATERIAL] * (share != 0.8)
    assert np.sign(round(after - before, 6)) == {0.45: 0, 0.8: -1, 2.2: 1}[share]


@pytest.mark.parametrize("kilowatts", [0.3, 1100.0, 31.0])
def test_watts_idle_power_and_more_than_the_drive_has_are_rejected(machine: Machine, kilowatts: float) -> None:
    with pytest.raises(ValueError, match="power_kw"):
        reading(machine, kilowatts * expected_kilowatts(machine) / 2.0)


def test_a_frequency_needs_a_verdict(machine: Machine) -> None:
    with pytest.raises(ValueError, match="has_chatter"):
        make_observed_cut(find_cut_setting(machine, "A", None, None, 1.0), "cannot tell", 1234.0)
