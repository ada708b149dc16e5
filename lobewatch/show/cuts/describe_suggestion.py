"""What test cuts have taught of a program, and the next one, for people and as JSON."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Table

from acquisition import Remark
from lobewatch.cuts.learning.contradicting import contradiction_remarks
from lobewatch.cuts.learning.lesson import Lesson, NextCut
from lobewatch.cuts.learning.posterior import Interval
from lobewatch.cuts.learning.suggest import Suggestion
from lobewatch.show.programs.describe_advice import rpm
from lobewatch.show.programs.describe_doubts import term
from lobewatch.show.terminal.output import table


def suggestion_json(next_cut: NextCut) -> dict[str, Any]:
    """The cut, and what it rests on."""
    cut, best = next_cut.suggested, _best(next_cut)
    return {
        "program": next_cut.lesson.program.name,
        "suggested": None if cut is None else _cut_json(cut),
        "cuts_made": len(next_cut.lesson.own_cuts),
        "cuts_left": next_cut.left,
        "best_heard": None if best is None else {"speed_rpm": best[0], "depth_mm": 1e3 * best[1]},
        "learnt": learnt_json(next_cut.lesson),
    }


def _cut_json(cut: Suggestion) -> dict[str, Any]:
    return {
        "speed_rpm": cut.speed_rpm,
        "depth_mm": round(1e3 * cut.depth, 6),
        "chance_of_chatter": cut.chance,
        "expected_gain": cut.gain,
        "settles": cut.settles,
        "repeats": cut.repeats or None,
    }


def suggestion_lines(next_cut: NextCut, folder: Path) -> Iterator[str]:
    """A line for each thing a person needs."""
    name, cut, n_made = next_cut.lesson.program.name, next_cut.suggested, len(next_cut.lesson.own_cuts)
    if cut is None:
        yield f"{name}: {_why_none(next_cut)}"
    else:
        depth = f"{1e3 * cut.depth:.4g}"
        yield (
            f"{name}: test cut {n_made + 1} of {n_made + next_cut.left}: {rpm(cut.speed_rpm)} rpm, {depth} mm, "
            f"chance of chatter {round(100 * cut.chance)} %; {_why(cut, next_cut.lesson)}"
        )
        observe = shlex.join(["lobewatch", "observe", str(folder), "--program", name])
        power = "" if next_cut.lesson.program.feed_per_tooth_mm is None else "; --power KW, where it is shown, tells Kt"
        yield f"then: {observe} --speed {cut.speed_rpm:g} --depth {depth} --stable (or --chatter --frequency HZ){power}"
    best = _best(next_cut)
    if best is not None:
        gain = f"; the next is expected to gain {100 * cut.gain:.0f} %" if cut and math.isfinite(cut.gain) else ""
        yield f"most chips heard stable: {1e3 * best[1]:.4g} mm at {rpm(best[0])} rpm{gain}"
    yield "a test cut is no advice: lobewatch check says what may be run"


def _why(cut: Suggestion, lesson: Lesson) -> str:
    if cut.repeats:
        is_believed = cut.repeats in [made.id for made in lesson.believed]
        return f"{cut.repeats} once more, since {'its word may be wrong' if is_believed else 'it is not believed'}"
    return f"it tells most of {term(cut.settles)}"


def _why_none(next_cut: NextCut) -> str:
    if not next_cut.left:
        return f"{len(next_cut.lesson.own_cuts)} test cuts are made; a larger --cuts asks for more"
    if next_cut.reach.is_empty:
        return f"no test cut: {next_cut.reach.words}; choose another tool"
    return "no test cut is worth making: nothing more is to be gained"


def _best(next_cut: NextCut) -> tuple[float, float] | None:
    """Speed (rpm) and depth (m) of most chips that were heard stable; None where none was."""
    lesson = next_cut.lesson
    believed = [cut for cut in lesson.own_cuts if cut not in lesson.doubted]
    stable = [(cut.speed_rpm, cut.depth) for cut in believed if not cut.chatters]
    return max(stable, key=lambda setting: setting[0] * setting[1], default=None)


def learnt_json(lesson: Lesson) -> dict[str, Any]:
    """Factors on what was tapped at rest (Kt, Kr/Kt: on what machine.toml says), with and without the cuts."""
    before, now = lesson.before.intervals, lesson.learnt.intervals
    return {
        "cuts": [cut.id for cut in lesson.believed],
        "chatter_frequencies": lesson.learnt.frequencies,
        "frequency_learnt": lesson.learnt.frequencies > 0,
        "effective_sample_size": lesson.learnt.size,
        "factors": {name: _interval_json(now[name]) | {"before": _interval_json(before[name])} for name in now},
    }


def _interval_json(interval: Interval) -> dict[str, float]:
    return {"mean": interval.mean, "low": interval.low, "high": interval.high, "std": interval.std}


def learnt_texts(lesson: Lesson) -> list[str | Table]:
    """What the cuts have taught; nothing where there are none."""
    count = len(lesson.believed)
    return [f"learnt from {count} cut{'s' if count > 1 else ''}:", learnt_table(lesson)] if count else []


def learnt_table(lesson: Lesson) -> Table:
    """Factors, a line each: before the cuts, and now."""
    rows = table("~at speed, over at rest", "before (95 %)", "learnt (95 %)")
    before, now = lesson.before.intervals, lesson.learnt.intervals
    for name in now:
        is_open = name.startswith("frequency") and not lesson.learnt.frequencies
        rows.add_row(term(name), _text(before[name]), "not learnt" if is_open else _text(now[name]))
    return rows


def _text(interval: Interval) -> str:
    return f"{interval.mean:.3f} ({interval.low:.3f}..{interval.high:.3f})"


def lesson_remarks(lesson: Lesson) -> Iterator[Remark]:
    """What was left out, and what the cuts say nothing of."""
    yield from contradiction_remarks(lesson.learnt, lesson.contradicting, lesson.program.name)
    if lesson.believed and not lesson.learnt.frequencies:
        text = "f not learnt: no chatter frequency was heard yet"
        yield Remark("frequency-not-learnt", lesson.program.name, text, "tell what the next chatter sounds at")
