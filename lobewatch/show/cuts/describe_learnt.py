"""What test cuts have taught of a program, for people and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from acquisition import Remark
from lobewatch.cuts.learning.contradicting import contradiction_remarks
from lobewatch.cuts.learning.of_program import Lesson
from lobewatch.cuts.learning.posterior import Interval
from lobewatch.show.programs.names import NAMES
from lobewatch.show.terminal.output import table


def learnt_json(found: Lesson) -> dict[str, Any]:
    """Factors on what was tapped at rest (Kt, Kr/Kt: on what machine.toml says), with and without the cuts."""
    before, now = found.before.intervals, found.learnt.intervals
    return {
        "cuts": [cut.id for cut in found.learnt.cuts],
        "chatter_frequencies": found.learnt.frequencies,
        "frequency_learnt": found.learnt.frequencies > 0,
        "effective_sample_size": found.learnt.size,
        "factors": {name: _interval_json(now[name]) | {"before": _interval_json(before[name])} for name in NAMES},
    }


def _interval_json(one: Interval) -> dict[str, float]:
    return {"mean": one.mean, "low": one.low, "high": one.high, "std": one.std}


def learnt_texts(found: Lesson) -> list[str | Table]:
    """What the cuts have taught; nothing where there are none."""
    count = len(found.learnt.cuts)
    return [f"learnt from {count} cut{'s' if count > 1 else ''}:", learnt_table(found)] if count else []


def learnt_table(found: Lesson) -> Table:
    """Factors, a line each: before the cuts, and now."""
    made = table("~at speed, over at rest", "before (95 %)", "learnt (95 %)")
    before, now = found.before.intervals, found.learnt.intervals
    for name, told in NAMES.items():
        is_open = name.startswith("frequency") and not found.learnt.frequencies
        made.add_row(told, _text(before[name]), "not learnt" if is_open else _text(now[name]))
    return made


def _text(one: Interval) -> str:
    return f"{one.mean:.3f} ({one.low:.3f}..{one.high:.3f})"


def lesson_remarks(found: Lesson) -> Iterator[Remark]:
    """What was left out, and what the cuts say nothing of."""
    yield from contradiction_remarks(found.learnt, found.contradicting, found.program.name)
    if found.learnt.cuts and not found.learnt.frequencies:
        text = "f not learnt: no chatter frequency was heard yet"
        yield Remark("frequency-not-learnt", found.program.name, text, "tell what the next chatter sounds at")
