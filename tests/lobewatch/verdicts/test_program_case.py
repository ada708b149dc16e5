"""Program as the spindle sees it: engagements, feed directions, wear, thin walls, missing keys."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from lobes import program_limit
from lobewatch.verdicts import Stability
from lobewatch.verdicts.program_case import ProgramCase, build_program
from lobewatch.verdicts.recommendation import advise, find_stable_pockets
from lobewatch.verdicts.verdict import evaluate_program

Shop = Any


@pytest.fixture
def judged(shop: Shop) -> Any:
    """Evaluate a program of the reference tool with changed lines."""
    shop.tap(0, 1713.0, stiffness=3e7)
    shop.tap(0.1, 1650.0, "y", stiffness=3.4e7)

    def judged(depth: float, *lines: str, radial: str = "5") -> Any:
        shop.run(("A", 12900, depth), more="\n".join(lines))
        toml = shop.path / "machine.toml"
        head, _, tail = toml.read_text("utf-8").rpartition("radial_depth_mm = 20\n")
        toml.write_text(f"{head}radial_depth_mm = {radial}\n{tail}", "utf-8")
        machine = shop.folder.machine
        (table,) = machine.program
        return evaluate_program(table, shop.logbook.assembly(), machine)

    return judged


def codes(verdict: Any) -> list[str]:
    return [remark.code for remark in verdict.remarks]


def test_a_range_is_evaluated_at_its_worst_inside(judged: Any, shop: Shop) -> None:
    verdict = judged(0.3, radial="[2, 12]")
    machine, tool = shop.folder.machine, verdict.assembly
    alone = [judged(0.3, radial=f"{depth:g}").limit for depth in (2, 5, 9, 12)]
    assert verdict.limit <= min(alone) * 1.0001
    cut = verdict.samples.cuts[0]
    limit = program_limit(build_program(verdict.program, machine), tool.x, tool.y, [cut]).limit
    assert limit == pytest.approx(verdict.limit, rel=1e-12)
    assert len({cut.immersion for cut in verdict.samples.cuts}) >= 4


def test_a_corner_takes_most_of_the_limit_whatever_the_feed(judged: Any, shop: Shop) -> None:
    straight, corner = judged(0.3, 'feed = "x"'), judged(0.3, "corner_radius_mm = 15", 'feed = "x"')
    assert corner.limit < 0.4 * straight.limit
    inside = [
        cut for cut in ProgramCase(corner.program, corner.assembly, shop.folder.machine).cuts if cut.immersion > 0.6
    ]
    assert len({cut.feed_angle for cut in inside}) == 12


def test_a_program_that_names_one_engagement_is_told_what_a_corner_would_do(judged: Any) -> None:
    verdict = judged(0.3)
    (remark,) = [remark for remark in verdict.remarks if remark.code == "one-engagement"]
    *depths, said = map(float, re.findall(r"([\d.]+) mm", remark.text))
    assert depths == [5, 15, 12]  # radial depth, radius of the corner, radial depth there
    assert said == pytest.approx(1e3 * judged(0.3, "corner_radius_mm = 15").limit, rel=0.3)
    for radial, lines in (("[5, 5]", ()), ("5", ("corner_radius_mm = 40",)), ("10", ())):
        assert "one-engagement" not in codes(judged(0.3, *lines, radial=radial))


@pytest.mark.parametrize(
    ("radial", "line", "remarked"), [("2", "", True), ("2", "helix_deg = 0", False), ("5", "", False)]
)
def test_a_helix_that_is_not_written_is_remarked_at_low_engagement(
    judged: Any, radial: str, line: str, remarked: bool
) -> None:
    assert ("helix-not-written" in codes(judged(0.3, line, radial=radial))) is remarked


def test_wear_lowers_the_low_end_and_nothing_else(judged: Any) -> None:
    new, used, worn = (judged(1.0, f'wear = "{wear}"', radial="20") for wear in ("new", "used", "worn"))
    assert new.limit == used.limit == worn.limit
    assert used.limit_low / new.limit_low == pytest.approx(1 / 1.3, abs=0.03)
    assert worn.limit_low / new.limit_low == pytest.approx(1 / 1.6, abs=0.03)
    force = worn.samples.rows.tangential[1:] / new.samples.rows.tangential[1:]
    assert (np.min(force), np.max(force)) == pytest.approx((1.0, 1.6), abs=1e-6)
    assert judged(1.0, radial="20").limit_low == new.limit_low


def test_wear_of_the_uncertainty_holds_for_all_programs(judged: Any, shop: Shop) -> None:
    worn = judged(1.0, 'wear = "worn"', radial="20")
    shop.edit("[speed]", '[doubt]\nwear = "worn"\n\n[speed]')
    assert judged(1.0, radial="20").limit_low == worn.limit_low
    assert judged(1.0, 'wear = "new"', radial="20").limit_low > 1.3 * worn.limit_low


def test_what_wear_decides_is_reported(judged: Any) -> None:
    new = judged(0.5, radial="20")
    worn = judged(round(0.93e3 * new.limit_low, 2), 'wear = "worn"', radial="20")
    assert (worn.stability, worn.decisive_cause) == (Stability.DOUBTFUL, "wear")


def test_a_thin_wall_is_never_called_stable(judged: Any, shop: Shop) -> None:
    assert judged(0.2, radial="20").stability is Stability.STABLE
    verdict = judged(0.2, "thin = true", radial="20")
    assert (verdict.stability, verdict.decisive_cause) == (Stability.DOUBTFUL, "workpiece")
    assert advise(verdict, shop.folder.machine).best is None
    assert find_stable_pockets(verdict.program, verdict.assembly, shop.folder.machine) == []
