"""Which cuts count as those of a program."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import Any

import msgspec
import pytest

from lobewatch.cuts.learning.posterior import Contradiction
from lobewatch.cuts.learning.program_learning import learn_program
from lobewatch.cuts.learning.suggestion import find_best_removal_rate
from lobewatch.machine.folder_updates import make_observed_cut
from lobewatch.machine.settings.requested_cut import find_cut_setting

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def test_a_cut_of_another_material_or_geometry_is_not_the_best_of_a_program(shop: Shop) -> None:
    """They teach of the spindle all the same."""
    shop.tap_both()
    machine, start = shop.folder.machine, shop.start
    setting = find_cut_setting(machine, "A", 12900, 1.0)
    own = replace(make_observed_cut(setting, "stable", at=start + timedelta(days=1)), id="c1")
    deeper = replace(own, depth=1.2e-3)
    softer = replace(deeper, id="c2", coefficients="brass", cut=replace(own.cut, tangential=0.5 * own.cut.tangential))
    narrower = replace(deeper, id="c3", cut=replace(own.cut, immersion=0.5 * own.cut.immersion))
    table = next(program for program in machine.program if program.name == "A")
    lesson = learn_program(table, shop.logbook.assembly(table.tool), machine, [own, softer, narrower])
    assert [cut.id for cut in lesson.own_cuts] == ["c1"]
    assert find_best_removal_rate(lesson.own_cuts) == pytest.approx(12900 * 1e-3)
    assert [cut.id for cut in lesson.posterior.cuts] == ["c1", "c2", "c3"]


def test_a_cut_of_a_material_by_another_of_its_names_is_one_of_the_program(shop: Shop) -> None:
    own_numbers = "tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\nspeed"
    shop.edit(own_numbers, 'material = "1.7225"\nspeed')
    shop.tap_both()
    setting = find_cut_setting(shop.folder.machine, "A", 12900, 0.5)
    heard = replace(make_observed_cut(setting, "stable", at=shop.start + timedelta(days=1)), id="c1")
    shop.edit('material = "1.7225"', 'material = "AISI 4140"')
    machine = shop.folder.machine
    table = next(program for program in machine.program if program.name == "A")
    lesson = learn_program(table, shop.logbook.assembly(table.tool), machine, [heard])
    assert (heard.coefficients, [cut.id for cut in lesson.own_cuts]) == ("42CrMo4", ["c1"])


def test_a_power_that_is_not_believed_is_reported_and_the_verdict_of_its_cut_counts(shop: Shop) -> None:
    """1.4 kW are as much as machine.toml expects at 1 mm."""
    shop.edit("radial_depth_mm = 20", "radial_depth_mm = 20\nfeed_per_tooth_mm = 0.1")
    shop.tap_both()
    machine = shop.folder.machine
    cuts = [
        replace(
            make_observed_cut(
                find_cut_setting(machine, "A", speed, 1.0, power), "stable", at=shop.start + timedelta(days=1)
            ),
            id=f"c{number}",
        )
        for number, (speed, power) in enumerate(((12900, 2.9), (12800, 2.9), (12700, 7.0)), 1)
    ]
    table = next(program for program in machine.program if program.name == "A")
    tool = shop.logbook.assembly(table.tool)
    lesson = learn_program(table, tool, machine, cuts)
    (odd,) = lesson.inconsistent_cuts
    assert (odd.cut.id, odd.contradiction) == ("c3", Contradiction.POWER)
    assert [cut.id for cut in lesson.accepted_cuts] == [cut.id for cut in lesson.own_cuts] == ["c1", "c2", "c3"]
    assert lesson.rejected_cuts == ()
    without = learn_program(table, tool, machine, [*cuts[:2], replace(cuts[2], power=None)])
    assert without.inconsistent_cuts == ()
    assert without.posterior.intervals == lesson.posterior.intervals


def test_learning_starts_from_the_drop_of_the_machine(shop: Shop) -> None:
    shop.tap_both()
    machine = shop.folder.machine
    speed = msgspec.structs.replace(machine.speed, drop_percent=(12.0, 12.0))
    machine = msgspec.structs.replace(machine, speed=speed)
    table = next(program for program in machine.program if program.name == "A")
    lesson = learn_program(table, shop.logbook.assembly(table.tool), machine, [])
    drop = lesson.prior.samples.drop
    assert (drop.low, drop.high) == pytest.approx((0.12, 0.12))
