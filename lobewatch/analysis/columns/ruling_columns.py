"""Word and limit of every program as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lobes import SldHistory
from lobewatch.analysis.programs.verdict import Ruling, Word

Rulings = Mapping[str, Ruling] | None
"""By program; None where nobody has asked yet."""


def limits(rulings: Rulings, programs: Sequence[str]) -> list[float]:
    """Limit of each program (m); NaN where nobody has asked yet."""
    return [rulings[name].limit if rulings else np.nan for name in programs]


def words(rulings: Rulings, programs: Sequence[str]) -> str:
    """One word a program, a line each; empty where nobody has asked yet."""
    return "\n".join(rulings[name].word for name in programs) if rulings else ""


def rulings_of(stored: SldHistory, i: int, programs: Sequence[str]) -> dict[str, Ruling] | None:
    """Those of a row of the stored history."""
    if not programs:
        return {}
    told = str(stored.columns["program_verdict"][i])
    if not told:
        return None
    depths = stored.columns["program_limit"][i].tolist()
    pairs = zip(programs, told.split("\n"), depths, strict=True)
    return {name: Ruling(Word(word), limit) for name, word, limit in pairs}
