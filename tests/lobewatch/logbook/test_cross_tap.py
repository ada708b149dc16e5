"""Cross tap with taps in x and y: determines the rotation of modes, and nothing else."""

from __future__ import annotations

from datetime import timedelta

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Circumstances, Frf, TapDirection, TapTest, from_accelerance, new_tap_id
from lobes import project_modes
from lobewatch.logbook import Logbook
from lobewatch.show.report.report import render_report
from lobewatch.tap.session import build_outcome
from modal import Mode, synthesize_frf
from tests.lobewatch.conftest import Shop

LINES = np.arange(4.0, 4000.0, 2.0)
PAIR = [Mode(1600.0, 0.03, 30e6), Mode(1720.0, 0.028, 33e6)]
NARROW = """
[[program]]
name = "N"
tool = "reference"
teeth = 4
tool_diameter_mm = 20
radial_depth_mm = [4, 4]
direction = "down"
tangential_n_per_mm2 = 1400
radial_n_per_mm2 = 500
speed_rpm = 9000
depth_mm = 0.5
helix_deg = 0
feed = "x"
"""


def turned_by(degrees: float) -> NDArray[np.float64]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, s], [-s, c]])


def tap(shop: Shop, days: float, direction: TapDirection, modes: list[Mode], seed: int = 0) -> None:
    about = Circumstances("m", shop.start + timedelta(days=days), "reference", direction, "", shop.folder.toml_text)
    random, frf = np.random.default_rng(seed), synthesize_frf(modes, LINES)
    noise = 1e-3 * np.max(np.abs(frf.accelerance)) * random.normal(size=(2, LINES.size))
    noisy: Frf = from_accelerance(LINES, frf.accelerance + noise[0] + 1j * noise[1])
    shop.folder.commit(TapTest(new_tap_id(about), about, noisy))


@pytest.fixture
def askew(shop: Shop) -> Shop:
    """Make a spindle with principal directions at 35 degrees, tapped in x and y, with a narrow program."""
    shop.put(NARROW)
    shown = project_modes(PAIR, turned_by(35))
    tap(shop, 0, "x", shown.x)
    tap(shop, 0.01, "y", shown.y)
    return shop


def remark_codes(logbook: Logbook) -> list[str]:
    (verdict,) = logbook.verdicts()
    return [remark.code for remark in verdict.remarks]


def test_a_cross_tap_decides_to_which_side_modes_lie(askew: Shop) -> None:
    before = askew.logbook
    assert "cross-not-tapped" in remark_codes(before)
    assert len(before.assembly("reference").principal_directions.sign_patterns) == 2
    tap(askew, 0.02, "xy", project_modes(PAIR, turned_by(35)).cross)
    after = askew.logbook
    assert [build_outcome(book, book.measurement(book.taps[-1].id)).needs_cross_tap for book in (before, after)] == [
        True,
        False,
    ]
    assert "cross-not-tapped" not in remark_codes(after)
    tool = after.assembly("reference")
    (pattern,) = tool.principal_directions.sign_patterns
    assert pattern is not None
    first = np.argmin(np.abs([mode.frequency - 1600.0 for mode in tool.x or ()]))
    assert pattern[first] == pytest.approx([np.cos(np.radians(35)), np.sin(np.radians(35))], abs=0.01)
    assert tool.directions == ("x", "y")
    assert tool.series.keys() == {"x", "y"}
    tap(askew, 0.03, "xy", project_modes(PAIR, turned_by(35)).cross, seed=2)
    assert askew.logbook.assembly("reference").series.keys() == {"x", "y"}


def test_a_cross_tap_is_a_series_of_its_own_and_asks_nothing(askew: Shop) -> None:
    tap(askew, 0.02, "xy", project_modes(PAIR, turned_by(35)).cross)
    logbook = askew.logbook
    standing = logbook.status(askew.start + timedelta(days=1))
    assert [series.direction for series in standing.series].count("xy") == 1
    assert not {"no-mode-in-band", "mode-lost", "one-direction"} & {remark.code for remark in standing.remarks}
    assert logbook.measurement(logbook.taps[-1].id).calibration is None
    assert "xy" in render_report(logbook, "reference", "x")
    tap(askew, 40, "x", project_modes(PAIR, turned_by(35)).x, seed=3)
    assert len(askew.logbook.assembly("reference").principal_directions.sign_patterns) == 1


def test_a_cross_tap_of_a_round_spindle_shows_nothing_and_loses_no_mode(shop: Shop) -> None:
    shop.put(NARROW)
    tap(shop, 0, "x", [PAIR[0]])
    tap(shop, 0.01, "y", [PAIR[0].scaled(1.001, 1.0, "")])
    tap(shop, 0.02, "xy", [Mode(1600.0, 0.03, 1e12)])
    logbook = shop.logbook
    assert logbook.assembly("reference").principal_directions.sign_patterns == [None]
    standing = logbook.status(shop.start + timedelta(days=1))
    assert not {"no-mode-in-band", "mode-lost"} & {remark.code for remark in standing.remarks}


@pytest.mark.parametrize(
    ("cross", "facts"),
    [
        ([Mode(1660.0, 0.03, 6e7)], ("1660 Hz", "3.6 %")),
        ([Mode(1600.0, 0.03, 5e6)], ("1600 Hz", "times")),
        (
            project_modes(PAIR, turned_by(35)).x,
            ("tap in x",),
        ),
    ],
)
def test_a_cross_tap_of_another_clamping_is_not_used(askew: Shop, cross: list[Mode], facts: tuple[str, ...]) -> None:
    tap(askew, 0.02, "xy", cross)
    tool = askew.logbook.assembly("reference")
    assert tool.cross is None
    (remark,) = [remark for remark in tool.remarks if remark.code == "cross-other-clamping"]
    assert all(fact in remark.text for fact in facts)
    assert "cross-not-tapped" in remark_codes(askew.logbook)


def test_a_cross_tap_alone_gives_no_tool(shop: Shop) -> None:
    shop.put(NARROW)
    tap(shop, 0, "xy", project_modes(PAIR, turned_by(35)).cross)
    assert shop.logbook.assembly("reference").directions == ()
    (verdict,) = shop.logbook.verdicts()
    assert verdict.stability.value == "unknown"


def test_stored_rows_hold_next_to_a_cross_tap_that_comes_later(askew: Shop) -> None:
    before = askew.logbook.history.rows
    tap(askew, 0.02, "xy", project_modes(PAIR, turned_by(35)).cross)
    rows = askew.logbook.history.rows
    assert [row.direction for row in rows] == ["x", "y", "xy"]
    assert [row.frequency for row in rows[:2]] == [row.frequency for row in before]
