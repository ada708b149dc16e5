"""Test report sections: each is one function, shared data is computed once, damaged tests are left out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lobewatch.show.figures.drawing import new_axes
from lobewatch.show.report.report import render_report
from lobewatch.show.report.report_data import ReportData
from lobewatch.show.report.section import BulletList, DataTable, Drawing, NumberTable, Paragraph, Section, TableCell
from lobewatch.show.report.sections import SECTIONS

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def hours(material: ReportData) -> list[Section]:
    """Make a section with all kinds of parts."""
    taken = [float(row.time.hour) for row in material.rows]
    figure, (axes,) = new_axes(1, (4.0, 2.0))
    axes.hist(np.array(taken))
    return [
        Section(
            "Hours, <all>",
            [
                Paragraph("Working hours."),
                Paragraph("Local time & date.", is_small=True),
                Paragraph(""),
                BulletList(["early", "late"]),
                DataTable(["hour", "how"], [["9", TableCell("fine", "ok")]], "words"),
                DataTable(["minute"], [], if_empty="no minutes", numbers=NumberTable(["minute"], [])),
                Drawing.of(figure, NumberTable(["hour"], [[hour] for hour in taken])),
            ],
        )
    ]


def test_a_new_section_is_one_function(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    before = render_report(shop.logbook, "reference", "x")
    html = render_report(shop.logbook, "reference", "x", sections=(*SECTIONS, hours))
    added = html[html.index('<section id="hours-all">') : html.index("</main>")]
    assert html.replace(added, "") == before
    lines = added.splitlines()
    assert lines[1:4] == [
        "<h2>Hours, &lt;all&gt;</h2>",
        "<p>Working hours.</p>",
        '<p class="sub">Local time &amp; date.</p>',
    ]
    assert lines[4:7] == ["", "<ul><li>early</li>", "<li>late</li>"]
    assert '<div class="wide" role="region" aria-label="Hours, &lt;all&gt;" tabindex="0"><table class="words">' in added
    assert '<thead><tr><th scope="col">hour</th><th scope="col">how</th></tr></thead>' in added
    assert '<tr><th scope="row">9</th><td class="ok">fine</td></tr>' in added
    assert '<tr><td colspan="1">no minutes</td></tr>' in added
    assert '<svg role="img" aria-label="Hours, &lt;all&gt;"' in added
    assert 'id="numbers-hours-all-7">{"heads":["hour"],"lines":[[9.0]]}</script>' in added
    assert 'data-numbers="numbers-hours-all-6" data-name="hours-all">CSV: hours, &lt;all&gt;</button>' in added


def test_numbers_have_keys_of_their_own(shop: Shop) -> None:
    for week in range(3):
        shop.tap(7 * week, 1713.0 - week)
    html = render_report(shop.logbook, "reference", "x")
    keys = re.findall(r'<script type="application/json" id="(.*?)"', html)
    names = ["natural-frequency-2", "stability-lobes-2", "bearing-stiffness-2", "frequency-response-2", "tap-tests-1"]
    assert keys == [f"numbers-{name}" for name in names]


def test_the_area_of_a_figure_lies_over_its_axes_in_units_of_their_data() -> None:
    figure, (axes,) = new_axes(1, (4.0, 2.0))
    axes.plot([10.0, 30.0], [5.0, 7.0], gid="line")
    axes.set(xlim=(10.0, 30.0), ylim=(5.0, 7.0))
    svg = Drawing.of(figure).svg
    (area,) = re.findall(r'<svg class="area" x="(.*?)" y="(.*?)" width="(.*?)" height="(.*?)" viewBox="(.*?)"', svg)
    assert area[4] == "10 -7 20 2"
    path = re.search(r'<g id="line">\s*<path d="M (\S+) (\S+) \nL (\S+) (\S+)', svg)
    assert path is not None
    (x, y, width, height), (left, bottom, right, top) = map(float, area[:4]), map(float, path.groups())
    assert (x, y + height, x + width, y) == pytest.approx((left, bottom, right, top), abs=0.02)


def test_the_oldest_test_is_left_out_where_its_file_turns_out_to_be_damaged(
    shop: Shop, monkeypatch: pytest.MonkeyPatch
) -> None:
    for week in range(3):
        shop.tap(7 * week, 1713.0 - week)
    assert len(shop.logbook.history.rows) == 3
    monkeypatch.setattr("lobewatch.machine.folder.MAX_HASHED_FILES", 1)
    oldest: Path = min((shop.path / "taps").glob("*.h5"))
    content = bytearray(oldest.read_bytes())
    content[len(content) // 2] ^= 1
    oldest.write_bytes(bytes(content))
    logbook = shop.logbook
    assert len(logbook.taps) == 3
    html = render_report(logbook, "reference", "x")
    assert ": 2 tap tests," in html
    assert oldest.name in html
