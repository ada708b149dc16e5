"""The demo's tap tests as a JSON object and as text: the truth, and what was found beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

from rich.table import Table

from lobewatch.show.output import table
from lobewatch.tap.demo import DemoTap, SpindleState

KEYS = ("frequency_hz", "damping_ratio", "stiffness_n_per_m", "bearing_stiffness_n_per_m")
"""Names of the figures of a SpindleState in JSON ..."""
NAMES = ("f_1", "zeta", "K", "bearing stiffness")
"""... and for people."""
COLUMNS = (("f_1 Hz", 1.0, 2), ("zeta %", 0.01, 3), ("K N/um", 1e6, 3), ("k_b N/um", 1e6, 1))
"""Heading, size of the unit and decimals."""


def demo_json(taps: Sequence[DemoTap], report: Path) -> dict[str, Any]:
    """All tap tests."""
    entries = [{"date": tap.date.isoformat(), "truth": _json(tap.truth), "found": _json(tap.found)} for tap in taps]
    return {"taps": entries, "report": str(report)}


def _json(state: SpindleState) -> dict[str, float]:
    return dict(zip(KEYS, astuple(state), strict=True))


def demo_texts(taps: Sequence[DemoTap], report: Path) -> list[str | Table]:
    """All tap tests for people, with the worst errors."""
    first, last = taps[0], taps[-1]
    found = last.found.relative_to(first.found).stiffness
    true = last.truth.relative_to(first.truth).stiffness
    return [
        "Emulated, and found beside it (f_1 natural frequency, zeta damping ratio, K stiffness at the tool tip,",
        "k_b stiffness of each bearing):",
        _table(taps),
        "worst error: " + ", ".join(_worst(taps)),
        f"K over the whole demo: {100 * found:+.2f} % found, {100 * true:+.2f} % true",
        f"report: {report}",
    ]


def _table(taps: Sequence[DemoTap]) -> Table:
    made = table("<month", *(word for heading, _, _ in COLUMNS for word in (heading, "found")))
    for tap in taps:
        pairs = zip(astuple(tap.truth), astuple(tap.found), strict=True)
        cells = [
            f"{value / scale:.{digits}f}"
            for pair, (_, scale, digits) in zip(pairs, COLUMNS, strict=True)
            for value in pair
        ]
        made.add_row(f"{tap.date:%Y-%m}", *cells)
    return made


def _worst(taps: Sequence[DemoTap]) -> list[str]:
    errors = zip(*(astuple(tap.found.relative_to(tap.truth)) for tap in taps), strict=True)
    return [f"{name} {100 * max(map(abs, values)):.2g} %" for name, values in zip(NAMES, errors, strict=True)]
