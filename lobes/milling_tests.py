"""Cutting coefficients measured by milling, one publication each (cutting_coefficients.csv beside this module)."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files

from lobes.coefficients import Coefficients

ALIKE = 2
"""Number of tests of an alloy from which on their range counts."""


@cache
def milling_tests() -> tuple[Coefficients, ...]:
    """All that come with this package, with the range over the tests of the same alloy; the spread is large."""
    text = (files("lobes") / "cutting_coefficients.csv").read_text(encoding="utf-8")
    tests = [_read(row) for row in csv.DictReader(text.splitlines())]
    return tuple(_with_ranges(test, [other for other in tests if other.alloy == test.alloy]) for test in tests)


def _read(row: dict[str, str]) -> Coefficients:
    return Coefficients(
        material=row["material"],
        tangential=float(row["Ktc_MPa"]) * 1e6,
        radial=float(row["Krc_MPa"]) * 1e6,
        tangential_edge=float(row["Kte_N_per_mm"] or "nan") * 1e3,
        radial_edge=float(row["Kre_N_per_mm"] or "nan") * 1e3,
        note=row["note"],
        source=row["source"],
        alloy=row["alloy"],
        iso_group=row["iso_group"],
    )


def _with_ranges(test: Coefficients, alike: Sequence[Coefficients]) -> Coefficients:
    if len(alike) < ALIKE:
        return test
    tangential = [other.tangential for other in alike]
    ratio = [other.radial / other.tangential for other in alike]
    return replace(test, tangential_range=(min(tangential), max(tangential)), ratio_range=(min(ratio), max(ratio)))
