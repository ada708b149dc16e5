"""Word and limit of every program as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lobewatch.verdicts.verdict import Ruling

Rulings = Mapping[str, Ruling] | None
"""By program; None where nobody has asked yet."""


def limits(rulings: Rulings, programs: Sequence[str]) -> list[float]:
    """Limit of each program (m); NaN where nobody has asked yet."""
    return [rulings[name].limit if rulings and name in rulings else np.nan for name in programs]


def words(rulings: Rulings, programs: Sequence[str]) -> str:
    """One word a program, a line each; empty where nobody has asked yet."""
    return "\n".join(rulings[name].word if name in rulings else "" for name in programs) if rulings else ""
