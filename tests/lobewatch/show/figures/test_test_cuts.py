"""Test which test cuts a lobe diagram shows, where, and that the report lists them."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from lobes import Cut, StabilityLobes
from lobewatch.cuts.learning.program_learning import LobesAtSpeed, compute_lobes_at_speed
from lobewatch.machine.folder_updates import store_cut
from lobewatch.machine.journal.entries import CutEntry, CutVerdict
from lobewatch.show.figures.lobe_figures import TEST_CUT_MARKS, plot_lobes, select_test_cuts
from lobewatch.show.report.report import render_report
from lobewatch.tool import compute_lobes
from lobewatch.verdicts.monte_carlo import LimitBand
from tests.lobewatch.show.figures.lobe_diagrams import diagram_of

SLOT = Cut(4, 1.0, "down", 1.4e9, 5e8)


def heard(word: CutVerdict, speed_rpm: float, depth: float, **changes: Any) -> CutEntry:
    cut = CutEntry(
        id=f"c{speed_rpm:.0f}",
        at=datetime(2026, 2, 1, tzinfo=UTC),
        program="A",
        tool="reference",
        cut=SLOT,
        coefficients="",
        feed="both",
        feed_per_tooth=None,
        commanded_rpm=speed_rpm,
        speed_rpm=speed_rpm,
        depth=depth,
        word=word,
        chatter_frequency_hz=None,
        by="ear",
        software="lobewatch 1",
    )
    return replace(cut, **changes)


def test_cuts_stand_where_they_were_made_and_say_what_they_chattered_at() -> None:
    cuts = [
        heard("stable", 1200.0, 1e-3),
        heard("chatter", 1500.0, 4e-3, chatter_frequency_hz=1650.4),
        heard("flip", 1700.0, 2e-3),
    ]
    speed = np.linspace(1000.0, 2000.0, 5)
    figure = plot_lobes(diagram_of(speed, {"now": np.full(5, 0.2e-3)}, heard=cuts))
    (axes,) = figure.axes
    stable, chatter = axes.lines[-2:]
    assert np.asarray(stable.get_xydata()).tolist() == [[1200.0, 1.0]]
    assert np.asarray(chatter.get_xydata()).tolist() == [[1500.0, 4.0], [1700.0, 2.0]]
    assert stable.get_marker() != chatter.get_marker()
    assert [line.get_label() for line in (stable, chatter)] == [TEST_CUT_MARKS[word][0] for word in (False, True)]
    assert [text.get_text() for text in axes.texts] == ["1650 Hz"]
    assert axes.get_ylim()[1] > 4.0


def test_what_cuts_have_taught_is_a_line_in_a_band_of_its_own() -> None:
    speed, depth = np.linspace(1000.0, 2000.0, 5), np.full(5, 1e-3)
    lobes = StabilityLobes(speed, depth, depth, np.full(5, "hopf"), depth[:, np.newaxis], "zero order")
    learnt = LobesAtSpeed(4, lobes, LimitBand(speed, 0.5 * depth, 3 * depth))
    (axes,) = plot_lobes(diagram_of(speed, {"now": 2 * depth}, learned=learnt)).axes
    (line,) = [artist for artist in axes.lines if "4 test cuts" in str(artist.get_label())]
    assert line.get_ydata() == pytest.approx(1.0)
    (band,) = [artist for artist in axes.collections if "98 %" in str(artist.get_label())]
    edge = np.asarray(band.get_paths()[0].vertices)[:, 1]
    assert (edge.min(), edge.max()) == pytest.approx((0.5, 3.0))


def test_lobes_at_speed_are_those_of_modes_and_coefficients_that_were_learnt(shop: Any) -> None:
    shop.run(("A", 12900, 1.5))
    shop.tap_both(0, 1.0)
    logbook = shop.logbook
    (at_rest,) = logbook.verdicts()
    assert compute_lobes_at_speed([at_rest], logbook.machine) is None
    for number in range(3):
        cut = heard(
            "stable", 12900.0, 1e-3 + 1e-4 * number, program="A", cut=logbook.machine.build_cut(at_rest.program)
        )
        store_cut(logbook.folder, cut)
    logbook = shop.logbook
    (taught,) = logbook.verdicts()
    learnt = compute_lobes_at_speed([taught], logbook.machine)
    assert learnt is not None
    assert learnt.n_cuts == 3
    assert taught.assembly is not None
    softer = float(np.min(compute_lobes(taught.at_speed.scale_modes(taught.assembly), logbook.machine)["A"].depth))
    push = (taught.program.tangential_n_per_mm2 or 0) / (at_rest.program.tangential_n_per_mm2 or 1)
    assert float(np.min(learnt.lobes.depth)) == pytest.approx(softer / push, rel=0.1)
    assert np.all(learnt.band.low <= learnt.lobes.depth)
    html = render_report(logbook, "reference", "x")
    assert re.search(r">at speed.* 3 .*</text>", html)
    assert "at speed: limiting depth (mm)" in html


@pytest.mark.parametrize(
    ("changes", "shown"),
    [
        ({}, True),
        ({"program": "B"}, True),
        ({"program": "B", "cut": replace(SLOT, tangential=1e9)}, False),
        ({"cut": replace(SLOT, tangential=1e9)}, True),
        ({"cut": replace(SLOT, immersion=0.5)}, False),
        ({"tool": "other"}, False),
        ({"excluded": "wrong depth"}, False),
        ({"word": "cannot tell"}, False),
    ],
)
def test_a_diagram_has_the_cuts_of_its_tool_cutter_and_immersion(changes: dict[str, Any], shown: bool) -> None:
    cut = replace(heard("stable", 1200.0, 1e-3), **changes)
    assert select_test_cuts([cut], "A", "reference", SLOT) == ([cut] if shown else [])


def test_the_report_shows_and_lists_test_cuts(shop: Any) -> None:
    shop.run(("A <1>", 12900, 1.5))
    shop.tap(0, 1713.0)
    html = render_report(shop.logbook, "reference", "x")
    assert 'id="test-cuts"' not in html
    cut = shop.logbook.machine.build_cut(shop.logbook.machine.program[0])
    stored = heard("chatter", 9000.0, 2e-3, program="A <1>", cut=cut, chatter_frequency_hz=1725.0)
    store_cut(shop.logbook.folder, stored)
    html = render_report(shop.logbook, "reference", "x")
    assert re.search(
        r"<td>A &lt;1&gt;</td><td>reference</td><td>9000</td><td>2</td><td>chatter .*1725.Hz</td><td>ear</td>", html
    )
    assert f">{TEST_CUT_MARKS[True][0]}</text>" in html
    assert ">1725 Hz</text>" in html
