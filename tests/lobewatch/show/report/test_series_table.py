"""The table of series: the margin to the alarm limit falls with the frequency drop."""

from __future__ import annotations

import html
import re
from typing import Any

import pytest

from lobewatch.show.report.report import render_report

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def series_cells(page: str) -> dict[str, str]:
    """Return the cells of the first row of the table of series by their headings."""
    table = page.partition('id="series"')[2].partition("</table>")[0]
    head, first = re.findall(r"<tr>.*?</tr>", table, re.DOTALL)[:2]
    rows = (
        [html.unescape(re.sub("<.*?>", "", cell)) for cell in re.findall(r"<t[hd].*?</t[hd]>", row, re.DOTALL)]
        for row in (head, first)
    )
    return dict(zip(*rows, strict=True))


@pytest.mark.parametrize(("frequency", "margin"), [(1713.0 * 0.96, 6.0), (1713.0 * 0.91, 1.0), (1713.0 * 0.85, None)])
def test_the_margin_is_the_alarm_limit_less_the_drop(shop: Shop, frequency: float, margin: float | None) -> None:
    shop.tap(0, 1713.0)
    shop.tap(30, frequency)
    cell = series_cells(render_report(shop.logbook, "reference", "x"))["margin to alarm"].replace("\u00a0", " ")
    if margin is None:
        assert cell == "exceeded"
    else:
        assert float(cell.removesuffix(" %")) == pytest.approx(margin, abs=0.02)
