"""Test report sections: each is one function, shared data is computed once, damaged tests are left out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lobewatch.show.figures.drawing import new_axes, render_svg
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
                Paragraph("When it was quiet."),
                Paragraph("Of the clock & the day.", is_small=True),
                Paragraph(""),
                BulletList(["early", "late"]),
                DataTable(["hour", "how"], [["9", TableCell("fine", "ok")]], "words"),
                DataTable(["minute"], [], if_empty="not looked at", numbers=NumberTable(["minute"], []), key="minutes"),
                Drawing(render_svg(figure), NumberTable(["hour"], [[hour] for hour in taken])),
            ],
        )
    ]


def test_a_new_section_is_one_function(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    before = render_report(shop.logbook, "reference", "x")
    drawn = before.count('data-numbers="numbers-') - before.count('data-numbers="numbers-taps')
    html = render_report(shop.logbook, "reference", "x", sections=(*SECTIONS, hours))
    added = html[html.index("<h2>Hours, &lt;all&gt;</h2>") : html.index("</main>")]
    assert html.replace(f"\n\n\n{added}", "\n") == before
    lines = added.splitlines()
    assert lines[1:3] == ["<p>When it was quiet.</p>", '<p class="sub">Of the clock &amp; the day.</p>']
    assert lines[3:6] == ["", "<ul><li>early</li>", "<li>late</li>"]
    assert '<div class="wide" role="region" aria-label="Hours, &lt;all&gt;" tabindex="0"><table class="words">' in added
    assert '<thead><tr><th scope="col">hour</th><th scope="col">how</th></tr></thead>' in added
    assert '<tr><td>9</td><td class="ok">fine</td></tr>' in added
    assert '<tr><td colspan="1">not looked at</td></tr>' in added
    assert '<figure class="large" tabindex="0"><svg role="img" aria-label="Hours, &lt;all&gt;"' in added
    assert f'id="numbers-{drawn + 1}">{{"heads":["hour"],"lines":[[9.0]]}}</script>' in added
    assert 'data-numbers="numbers-minutes" data-name="hours-&lt;all&gt;">CSV: hours, &lt;all&gt;</button>' in added


def test_numbers_have_keys_of_their_own(shop: Shop) -> None:
    for week in range(3):
        shop.tap(7 * week, 1713.0 - week)
    html = render_report(shop.logbook, "reference", "x")
    keys = re.findall(r'<script type="application/json" id="(.*?)"', html)
    assert keys == ["numbers-1", "numbers-2", "numbers-3", "numbers-5", "numbers-course", "numbers-taps"]


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
    assert "direction x: 2 tap tests" in html
    assert oldest.name in html
