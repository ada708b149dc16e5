"""Verdicts, advice and history where test cuts have taught, and as before where they have not."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import exclude_entry
from lobewatch.verdicts import Stability

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def judged(shop: Shop, name: str = "A") -> Any:
    (verdict,) = (verdict for verdict in shop.logbook.verdicts() if verdict.program.name == name)
    return verdict


def test_verdicts_are_at_speed_from_the_first_cut_on_and_narrower_with_more(shop: Shop) -> None:
    shop.run(("A", 12900, 1.5))
    shop.tap_both()
    at_rest = judged(shop)
    assert at_rest.n_cuts == 0
    shop.hear(12900, 3.0, "stable")
    first = judged(shop)
    for speed, depth in ((8700, 2.2), (12900, 3.4)):
        shop.hear(speed, depth, "stable")
    shop.hear(8700, 3.0, "chatter", 1710.0)
    four = judged(shop)
    assert (first.n_cuts, four.n_cuts) == (1, 4)
    assert (at_rest.samples.uncertainty.learned is None, four.samples.uncertainty.learned is None) == (True, False)
    assert four.limit_high / four.limit_low < first.limit_high / first.limit_low
    assert four.limit_low > first.limit_low
    assert four.stability is Stability.STABLE
    assert four.chatter_risk < at_rest.chatter_risk
    assert four.program.tangential_n_per_mm2 < at_rest.program.tangential_n_per_mm2
    assert [draws.rows.tangential[0] for draws in (at_rest.samples, four.samples)] == pytest.approx(
        [1.4e9, four.program.tangential_n_per_mm2 * 1e6]
    )


def test_what_holds_at_rest_and_what_at_speed_stands_below_the_diagram(shop: Shop) -> None:
    shop.run(("A", 12900, 1.5))
    shop.edit("steps = 200", "steps = 50")
    shop.tap_both()
    assert "rotating" not in CliRunner().invoke(app, ["lobes", str(shop.path)]).stdout
    shop.hear(12900, 3.0, "stable")
    text = " ".join(CliRunner().invoke(app, ["lobes", str(shop.path)]).stdout.split())
    assert re.search(r"learned from 1 test cut\b.*pockets.*not rotating", text)
    one_cut = " ".join(CliRunner().invoke(app, ["lobes", str(shop.path), "--cut", "A"]).stdout.split())
    assert re.search(r"learned from 1 test cut\b.*not rotating", one_cut)


def test_the_history_keeps_the_verdict_that_the_cuts_have_made_and_forgets_it_with_them(shop: Shop) -> None:
    shop.run(("A", 12900, 1.5), ("B", 8700, 0.4))
    shop.edit("drop_percent = [0, 0]\n", "")
    shop.tap_both()
    before = shop.logbook.verdicts()
    assert words(shop.logbook) == {verdict.program.name: verdict.stability for verdict in before}
    cut = shop.hear(12900, 1.5, "chatter")
    after = shop.logbook.verdicts()
    assert words(shop.logbook) == {verdict.program.name: verdict.stability for verdict in after}
    assert judged(shop).stability is not Stability.STABLE
    exclude_entry(shop.folder, cut.id, "a chip was stuck")
    again = shop.logbook.verdicts()
    assert words(shop.logbook) == {verdict.program.name: verdict.stability for verdict in before}
    for earlier, now in zip(before, again, strict=True):
        assert (now.limit, now.limit_low, now.limit_high) == (earlier.limit, earlier.limit_low, earlier.limit_high)
        assert np.array_equal(now.samples.rows.frequency, earlier.samples.rows.frequency)


def words(logbook: Logbook) -> dict[str, Stability]:
    rulings = logbook.stored_verdicts(logbook.history.rows[-1].tap_id)
    return {name: ruling.stability for name, ruling in rulings.items()}


def test_cuts_of_another_tool_say_nothing_and_what_contradicts_is_reported(shop: Shop) -> None:
    shop.run(("A", 12900, 1.5))
    shop.tap_both()
    shop.tap(0.2, 1500.0, tool="long")
    for depth, word in ((3.0, "stable"), (3.1, "stable"), (0.3, "chatter")):
        shop.hear(12900, depth, word)
    verdict = judged(shop)
    assert verdict.n_cuts == 2
    assert [remark.about for remark in verdict.remarks if remark.code == "cut-unexplained"] == ["c3"]
    shop.edit('tool = "reference"', 'tool = "long"')
    assert judged(shop).n_cuts == 0


def test_cuts_do_not_settle_a_direction_that_was_not_tapped(shop: Shop) -> None:
    """Even where no spindle that explains them chatters at the program."""
    shop.run(("A", 12900, 0.5))
    shop.tap(0, 1713.0)
    shop.hear(12900, 1.0, "stable")
    verdict = judged(shop)
    assert (verdict.stability, verdict.decisive_cause) == (Stability.DOUBTFUL, "untapped")
