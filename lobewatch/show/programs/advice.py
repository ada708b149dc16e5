"""Verdicts with advice, as `lobewatch check` and the report say them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.table import Table

from acquisition import Remark
from lobewatch.logbook import Logbook
from lobewatch.machine import SpeedRange
from lobewatch.show.programs.settings import rpm, setting_json, spare
from lobewatch.show.programs.verdicts import verdict_json, verdict_table
from lobewatch.tool import Assembly
from lobewatch.verdicts import Advice, Setting, Verdict, Word
from lobewatch.verdicts.verdict import Ruling

IN_LINES = ("doubt-decides", "not-checked")
"""Remarks that the lines of a program hold already."""
ALIKE = 1.02
"""Directions of feed whose limits differ by less are not told apart."""


@dataclass(frozen=True, eq=False)
class ProgramAdvice:
    """A program with all that is said of it."""

    verdict: Verdict
    """The word and the limit."""
    advice: Advice
    """Where to go, and how much decay is left."""
    then: Ruling | None
    """At the first tap tests of the same tool and directions; None without earlier ones."""

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Of both."""
        return (*self.verdict.remarks, *self.advice.remarks)

    @property
    def notes(self) -> tuple[Remark, ...]:
        """The remarks that are said apart from its lines."""
        return tuple(remark for remark in self.remarks if remark.code not in IN_LINES)

    @property
    def is_no_longer_stable(self) -> bool:
        """Whether it chatters now, and did not at first."""
        return self.verdict.stable is False and self.then is not None and bool(self.then.stable)


def advised(logbook: Logbook, verdict: Verdict) -> ProgramAdvice:
    """All that is said of one program."""
    return ProgramAdvice(verdict, logbook.advice(verdict), logbook.ruling_then(verdict))


def advised_json(one: ProgramAdvice) -> dict[str, Any]:
    """One program."""
    return verdict_json(one.verdict) | {
        "was_stable_at_first": None if one.then is None else one.then.stable,
        "verdict_at_first": None if one.then is None else one.then.word,
        "advice": setting_json(one.advice.best),
        "advice_here": setting_json(one.advice.here),
        "tolerable_decay": one.advice.decay,
        "remarks": [asdict(remark) for remark in one.remarks],
    }


def advised_table(programs: Sequence[ProgramAdvice]) -> Table:
    """Programs, a line each."""
    return verdict_table([one.verdict for one in programs], [decay_text(one.advice) for one in programs])


def decay_text(advice: Advice) -> str:
    """How far the frequency may fall in the middle of the doubt."""
    if math.isnan(advice.decay):
        return "-"
    if advice.decay == 0:
        return "none"
    return "> 20 %" if math.isinf(advice.decay) else f"{100 * advice.decay:.1f} %"


def counts(programs: Sequence[ProgramAdvice]) -> dict[str, int]:
    """How many there are of each that may not be run."""
    words = Counter(one.verdict.word for one in programs)
    return {
        "unstable": words[Word.NOT_STABLE],
        "doubtful": words[Word.DOUBTFUL],
        "not_checked": words[Word.UNKNOWN],
        "beyond_drive": sum(one.verdict.is_beyond_drive for one in programs),
    }


def summary(programs: Sequence[ProgramAdvice]) -> str:
    """How many there are of each word."""
    words = Counter(one.verdict.word for one in programs)
    said = [f"{words[word]} {word}" for word in Word if words[word]]
    beyond = counts(programs)["beyond_drive"]
    said += [f"{beyond} beyond the drive"] if beyond else []
    return f"{len(programs)} program{'s' if len(programs) > 1 else ''}: {', '.join(said)}"


def advised_lines(one: ProgramAdvice, speeds: SpeedRange) -> Iterator[str]:
    """What is wrong and what to do, a line for each thing that is called for."""
    found = one.verdict
    name = found.program.name
    if found.word is Word.UNKNOWN:
        yield from (str(remark) for remark in found.remarks if remark.code == "not-checked")
    elif found.word is Word.NOT_STABLE:
        yield f"{name}: {_chatter(one)}; {_elsewhere(one, speeds)}"
    elif found.word is Word.DOUBTFUL:
        settles = [remark for remark in found.remarks if remark.code == "doubt-decides"]
        said = [f"{remark.text}; to settle it: {remark.cure}" for remark in settles]
        yield f"{name}: {'; '.join([*said, *_or_elsewhere(one, speeds)])}"
    if found.is_beyond_drive:
        yield f"{name}: [drive] allows no more than {_floored(found.drive_limit)} mm at this speed"


def _chatter(one: ProgramAdvice) -> str:
    found = one.verdict
    word = "period-two chatter" if found.kind == "flip" else "chatter"
    where = f" near {found.chatter_frequency:.0f} Hz" if math.isfinite(found.chatter_frequency) else ""
    said = f"{word}{where}{_worst_feed(found)}"
    return f"stable at first, no longer: {said}" if one.is_no_longer_stable else said


def _worst_feed(found: Verdict) -> str:
    """The direction of feed that is worst, where it matters."""
    limits = np.ones(1) if found.drawn is None else found.drawn.limits
    if np.max(limits) <= ALIKE * np.min(limits):
        return ""
    degrees = round(math.degrees(found.feed_angle))
    return f", worst fed along {({0: 'x', 90: 'y'}).get(degrees, f'{degrees} degrees from x')}"


def _or_elsewhere(one: ProgramAdvice, speeds: SpeedRange) -> Iterator[str]:
    """What to do until it is settled; tapping what was not tapped comes first."""
    if one.verdict.assembly is not None and one.verdict.assembly.is_sure:
        yield f"until then {_elsewhere(one, speeds)}"


def _elsewhere(one: ProgramAdvice, speeds: SpeedRange) -> str:
    """Where to go."""
    program, best, here = one.verdict.program, one.advice.best, one.advice.here
    known = one.verdict.assembly
    if known is not None and len(known.directions) == 1:
        return f"tap direction {_missing(known)} too: only then can a safe speed be named"
    if known is not None and known.questions:
        cure = "answer what is asked of its tap tests"
        cure = "tap again" if any(one.code == "newest-damaged" for one in known.questions) else cure
        return f"{cure}: only then can a safe speed be named"
    reach = f"in {rpm(speeds.low_rpm)} to {rpm(speeds.high_rpm)} rpm"
    if best is None:
        return f"no safe speed {reach}; choose another tool"
    if best.depth_mm == program.depth_mm:
        return f"run this depth at {rpm(best.speed_rpm)} rpm {spare(best)}"
    said = [f"no safe speed for this depth {reach}"]
    said += (
        [] if _same(best, here) else [f"most chips: {best.depth_mm:g} mm at {rpm(best.speed_rpm)} rpm {spare(best)}"]
    )
    said += [] if here is None else [f"at {rpm(here.speed_rpm)} rpm no deeper than {here.depth_mm:g} mm {spare(here)}"]
    return "; ".join(said)


def _same(best: Setting, here: Setting | None) -> bool:
    return here is not None and (best.speed_rpm, best.depth_mm) == (here.speed_rpm, here.depth_mm)


def _missing(known: Assembly) -> str:
    return "y" if known.directions[0] == "x" else "x"


def _floored(depth: float) -> str:
    """The deepest cut (mm) of two decimals that is not deeper (m)."""
    return f"{math.floor(depth * 1e5) / 100:.2f}"
