"""What was found of a computer, as a table and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from lobewatch.sensors import Finding
from lobewatch.show.terminal.output import table


def findings_json(findings: Sequence[Finding]) -> dict[str, Any]:
    """All findings, and how many stand in the way."""
    return {"findings": [asdict(finding) for finding in findings], "hinder": _count(findings, "hinders")}


def findings_texts(findings: Sequence[Finding]) -> list[str | Table]:
    """A table, a line each with its cure, and a count."""
    rows = table("<", "<what", "~there is", "~what to do")
    marks = {"fine": "✓", "note": "·", "hinders": "✗"}
    for finding in findings:
        rows.add_row(marks[finding.state], *map(escape, (finding.subject, finding.text, finding.cure)))
    hinder, notes = _count(findings, "hinders"), _count(findings, "note")
    end = f"{hinder} of {len(findings)} stand in the way of a tap test" if hinder else "Nothing stands in the way"
    return [rows, f"{end}; {notes} worth knowing" if notes else end]


def _count(findings: Sequence[Finding], state: str) -> int:
    return sum(finding.state == state for finding in findings)
