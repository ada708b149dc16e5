"""Process damping: unknown until cuts teach it, stated by its low end, raised by a wear land."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
import pytest

from lobes import Program, program_limit
from lobewatch.cuts.learning.cut_likelihood import CutEvidence, PowerEvidence
from lobewatch.cuts.learning.posterior import Posterior, build_prior
from lobewatch.cuts.learning.process_damping import ABSENT_SHARE, ProcessDamping, find_process_damping
from lobewatch.cuts.learning.program_learning import evaluate_at_speed, find_program, learn_spindle
from lobewatch.machine.folder_updates import make_observed_cut, store_cut
from lobewatch.machine.settings.requested_cut import build_requested_program, find_cut_setting
from lobewatch.verdicts.uncertainty import uncertainty_of
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill, doubt

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
OPEN = ProcessDamping(0.0, 5e5, 0.02)
SLOW, FAST = 1200.0, 12900.0
"""Spindle speeds at lobes 21 and 2 (rpm)."""
KNOWN_FORCE = PowerEvidence(1.0, 0.02, 0.02)


@pytest.fixture(scope="module")
def prior() -> Posterior:
    return build_prior(Mill().middle, doubt(), 700, damping=OPEN)


def lowest_share(learnt: Posterior) -> float:
    """Return the weight of the samples without process damping."""
    return float(np.sum(learnt.weights[learnt.samples.process_damping(0) == 0]))


def test_half_of_the_samples_have_none_before_the_cuts(prior: Posterior) -> None:
    damping = prior.samples.process_damping(0)
    assert lowest_share(prior) == pytest.approx(ABSENT_SHARE, abs=0.06)
    assert np.max(damping) == pytest.approx(5e5, rel=0.02)
    rows = prior.samples.build_rows(SLOW, 1e9, 3e8)
    assert rows.process_damping == pytest.approx(damping / 0.02)
    assert prior.samples.with_materials(2, 0).process_damping(1).shape == damping.shape


def test_samples_without_open_process_damping_are_those_of_before() -> None:
    bare, known = (build_prior(Mill().middle, doubt(), 50, damping=d) for d in (OPEN, ProcessDamping(7.0, 7.0, 1.0)))
    assert np.array_equal(bare.samples.normal[:, :-1], known.samples.normal)
    assert known.samples.process_damping(0).tolist() == [7.0] * 50


def test_deep_stable_cuts_at_low_speed_teach_it_and_fast_ones_do_not(prior: Posterior) -> None:
    deep = CutEvidence(SLOT, SLOW, 3e-3, "stable", power=KNOWN_FORCE)
    fast = CutEvidence(SLOT, FAST, 1e-3, "stable", power=KNOWN_FORCE)
    assert lowest_share(prior.learn_from(deep)) < 0.1
    assert lowest_share(prior.learn_from(fast)) == pytest.approx(lowest_share(prior), abs=0.1)


def test_chatter_at_low_speed_speaks_against_it(prior: Posterior) -> None:
    chatter = CutEvidence(SLOT, SLOW, 1.5e-3, "chatter", 1720.0, power=KNOWN_FORCE)
    before, after = (one.intervals["process_damping"].mean for one in (prior, prior.learn_from(chatter)))
    assert after < 0.7 * before


def slow_slot(shop: Shop, depth: float = 0.3, more: str = "") -> Any:
    """Return the slot A at low speed, with more keys, and tap both directions."""
    shop.edit("low_rpm = 3000", "low_rpm = 600")
    shop.run(("A", SLOW, depth), more=more)
    shop.tap_both()
    return find_program(shop.folder.machine, "A")


def test_it_counts_by_its_low_end_where_it_is_stated(shop: Shop) -> None:
    table = slow_slot(shop, more="process_damping_n_per_m = [1e5, 3e5]\n")
    machine, tool = shop.folder.machine, shop.logbook.assembly("reference")
    assert find_process_damping(table, machine) == (1e5, 3e5, 0.02)
    verdict = evaluate_at_speed(table, tool, machine, ())
    cut = replace(machine.build_cut(table), feed_angle=verdict.feed_angle)
    limits = [
        program_limit(Program(replace(cut, process_damping=c / 0.02), SLOW, 3e-4), tool.x, tool.y).limit
        for c in (0.0, 1e5)
    ]
    assert verdict.limit == pytest.approx(limits[1], rel=1e-6)
    assert limits[1] > 1.3 * limits[0]
    assert "process-damping" in [remark.code for remark in verdict.remarks]
    assert verdict.samples is not None
    assert np.all(verdict.samples.rows.process_damping == 1e5 / 0.02)


def test_it_is_not_counted_before_cuts_have_taught_it(shop: Shop) -> None:
    table = slow_slot(shop)
    made = find_cut_setting(shop.folder.machine, "A", FAST, 0.5)
    store_cut(shop.folder, make_observed_cut(made, "stable", at=shop.start + timedelta(days=1)))
    machine, tool = shop.folder.machine, shop.logbook.assembly("reference")
    at_speed = learn_spindle(table, tool, machine, shop.logbook.cuts)
    assert at_speed.n_cuts == 1
    assert at_speed.process_damping == 0
    assert at_speed.uncertainty is not None
    assert at_speed.uncertainty.learned is not None
    assert not np.any(at_speed.uncertainty.learned.process_damping)


def test_a_wear_land_raises_what_may_be_there_and_the_force(shop: Shop) -> None:
    bare = slow_slot(shop)
    machine, tool = shop.folder.machine, shop.logbook.assembly("reference")
    worn = replace_keys(bare, wear_land_um=150.0)
    assert find_process_damping(worn, machine) == pytest.approx((0.0, 5e5 + 3e13 * 150e-6**2 / 2, 0.02))
    wears = [replace_keys(worn, wear=wear) for wear in (None, "used", "worn")]
    assert [uncertainty_of(tool, table, machine).wear for table in wears] == pytest.approx([1.3, 1.3, 1.6])
    assert uncertainty_of(tool, bare, machine).wear == 1
    assert machine.build_cut(worn) == machine.build_cut(bare)


def replace_keys(table: Any, **keys: Any) -> Any:
    return type(table)(**{name: getattr(table, name) for name in table.__struct_fields__} | keys)


def test_the_journal_has_no_process_damping(shop: Shop) -> None:
    slow_slot(shop, more="process_damping_n_per_m = [1e5, 3e5]\n")
    made = find_cut_setting(shop.folder.machine, "A", SLOW, 0.5)
    assert made.cut.process_damping == 1e5 / 0.02
    stored = store_cut(shop.folder, make_observed_cut(made, "stable", at=shop.start + timedelta(days=1)))
    assert "process_damping" not in stored.line["cut"]
    assert shop.logbook.cuts[0].cut.process_damping == 0


def test_a_cut_of_another_material_does_not_inherit_it(shop: Shop) -> None:
    slow_slot(shop, more="process_damping_n_per_m = [1e5, 3e5]\n")
    asked = {"tool": "reference", "speed_rpm": SLOW, "depth_mm": 0.3}
    own = build_requested_program(shop.folder.machine, asked)
    other = build_requested_program(shop.folder.machine, asked | {"material": "42CrMo4"})
    assert [own.process_damping_n_per_m, other.process_damping_n_per_m] == [(1e5, 3e5), None]


def test_a_range_in_falling_order_is_rejected(shop: Shop) -> None:
    table = slow_slot(shop)
    with pytest.raises(ValueError, match="process_damping_n_per_m"):
        replace_keys(table, process_damping_n_per_m=(3e5, 1e5))
