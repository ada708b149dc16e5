"""Rows that cannot be worked out anew and are kept, and said so.

In its place where the analysis refuses a tap test now, beside the history where its file cannot be used.
"""

from __future__ import annotations

from dataclasses import replace

from acquisition import Remark
from lobewatch.history.history import History, Row
from lobewatch.tool.order import Place

IN_PLACE, ASIDE = "row-of-older-version", "row-kept"
"""Codes of the remarks on them."""


def kept_in_place(row: Row, place: Place, error: Exception) -> Row:
    """The row of an older version of a tap test whose analysis now ends in an error."""
    text = f"as {row.software} worked it out: this version cannot ({error})"
    others = [remark for remark in row.remarks if remark.code != IN_PLACE]
    remarks = (*others, Remark(IN_PLACE, f"tap test {row.tap_id}", text, "exclude it where it does not count"))
    under = place.entry.conditions
    return replace(row, baseline=place.baseline, series=place.series, conditions=under, remarks=remarks)


def kept_aside(row: Row, software: str) -> Row:
    """The row of a tap test whose file cannot be used; software: that made it, where the row does not say."""
    software_then = row.software or software
    text = f"its file cannot be used: as {software_then} worked it out, and counts for nothing"
    others = [remark for remark in row.remarks if remark.code != ASIDE]
    remark = Remark(ASIDE, f"taps/{row.tap_id}.h5", text, "put it back from a backup")
    return replace(row, software=software_then, remarks=(*others, remark))


def of_older_versions(history: History | None) -> list[Remark]:
    """The remarks on rows that count though they could not be worked out anew."""
    rows = [] if history is None else [row for row in history.rows if row.software]
    return [remark for row in rows for remark in row.remarks if remark.code == IN_PLACE]
