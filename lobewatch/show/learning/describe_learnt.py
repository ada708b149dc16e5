"""What test cuts have taught of a program, for people and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rich.table import Table

from acquisition import Remark
from lobewatch.analysis.learning.contradicting import Contradicting, Contradiction
from lobewatch.analysis.learning.learnt import Interval
from lobewatch.analysis.learning.of_program import Lesson
from lobewatch.show.output import table

NAMES = {
    "tangential": "Kt",
    "ratio": "Kr/Kt",
    "frequency_x": "f_n in x",
    "frequency_y": "f_n in y",
    "damping_x": "zeta in x",
    "damping_y": "zeta in y",
    "stiffness_x": "K in x",
    "stiffness_y": "K in y",
}
"""Of what is learnt."""


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
    yield from map(unexplained, found.contradicting)
    if found.learnt.cuts and not found.learnt.frequencies:
        text = "f not learnt: no chatter frequency was heard yet"
        yield Remark("frequency-not-learnt", found.program.name, text, "tell what the next chatter sounds at")


def unexplained(odd: Contradicting) -> Remark:
    """A cut that no spindle explains which explains the others."""
    cut = odd.cut
    at = f"at {cut.speed_rpm:.6g} rpm, {1e3 * cut.depth:.4g} mm"
    pitch = f" at {cut.frequency:.0f} Hz" if math.isfinite(cut.frequency) else ""
    text, cure = {
        Contradiction.FREQUENCY: (
            f"chatters{pitch} {at}, where no mode is: workpiece or fixture?",
            "tap the workpiece where it is cut",
        ),
        Contradiction.CHATTERS: (
            f"chatters{pitch} {at}, which no spindle does that explains the others: workpiece, fixture, worn tool?",
            "cut it again; tap again if it stays",
        ),
        Contradiction.STABLE: (
            f"stable {at}, which no spindle is that explains the others: another depth or speed than told?",
            "cut it again, or take it out with lobewatch exclude",
        ),
    }[odd.why]
    return Remark("cut-unexplained", cut.id, f"{text}; left out", cure)
