"""Show verdicts with advice, for `lobewatch check` and the report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from acquisition import Remark
from lobewatch.logbook import Logbook
from lobewatch.logbook.analysis import Analysis
from lobewatch.machine import Machine
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.show.programs.verdicts import verdict_json, verdict_notes, verdict_table
from lobewatch.show.terminal.json_fields import json_fields
from lobewatch.show.terminal.output import count_noun, remark_lines
from lobewatch.verdicts import Advice, Setting, Stability, Verdict
from lobewatch.verdicts.setting_robustness import CHECKED_DROPS
from lobewatch.verdicts.verdict import StoredVerdict, find_open_question, is_compliance_known

NO_LIMIT_CODES = ("not-checked", "heard-alone")
"""Codes of remarks that replace a limit."""
LINE_REMARK_CODES = ("doubt-decides", *NO_LIMIT_CODES)
"""Codes of remarks that the advice lines contain."""
MIN_FEED_RATIO = 1.02
"""Smallest ratio of the limits along two feed directions that is worth a note."""


@dataclass(frozen=True, eq=False)
class ProgramAdvice:
    """Program with its verdict and advice."""

    verdict: Verdict
    """Verdict and limit."""
    advice: Advice
    """Recommended settings, and the tolerable frequency drop."""
    first_verdict: StoredVerdict | None
    """Verdict at the first tap tests of the same tool and directions; None without earlier ones."""

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks of verdict and advice."""
        return (*self.verdict.remarks, *self.advice.remarks)

    @property
    def other_remarks(self) -> tuple[Remark, ...]:
        """Remarks that the advice lines do not contain."""
        return tuple(remark for remark in self.remarks if remark.code not in LINE_REMARK_CODES)

    @property
    def is_no_longer_stable(self) -> bool:
        """True if the program chatters now and did not at first."""
        return self.verdict.is_stable is False and self.first_verdict is not None and bool(self.first_verdict.is_stable)


def advise_program(logbook: Logbook | Analysis, verdict: Verdict) -> ProgramAdvice:
    """Return one program with its verdict and advice."""
    return ProgramAdvice(verdict, logbook.advice(verdict), logbook.initial_verdict(verdict))


def check_json(programs: Sequence[ProgramAdvice], remarks: Sequence[Remark]) -> dict[str, Any]:
    """Return all programs with advice, and how many may not be run; remarks: on the files."""
    return {"programs": [advice_json(program) for program in programs], **count_unsafe(programs), "remarks": remarks}


def check_texts(programs: Sequence[ProgramAdvice], remarks: Sequence[Remark], machine: Machine) -> list[str | Table]:
    """Return all programs in words: the table, the advice, and notes on reading it."""
    decays = [frequency_margin_text(program.advice) for program in programs]
    verdicts = [program.verdict for program in programs]
    return [
        verdict_table(verdicts, decays),
        *(line for program in programs for line in advice_lines(program, machine)),
        *verdict_notes(verdicts, machine),
        *remark_lines([*remarks, *(remark for program in programs for remark in program.other_remarks)]),
    ]


ADVICE_FIELDS = json_fields("""
    was_stable_at_first=first_verdict.is_stable verdict_at_first=first_verdict.stability advice=advice.best
    advice_here=advice.deepest_here tolerable_decay=advice.tolerable_drop remarks
""")


def advice_json(program: ProgramAdvice) -> dict[str, Any]:
    """Return one program with its verdict and advice."""
    settings = {"advice": setting_json(program.advice.best), "advice_here": setting_json(program.advice.deepest_here)}
    return verdict_json(program.verdict) | ADVICE_FIELDS(program) | settings


def frequency_margin_text(advice: Advice) -> str:
    """Return how far f1 can drop before the program chatters (median estimate)."""
    if math.isnan(advice.tolerable_drop):
        return "-"
    if advice.tolerable_drop == 0:
        return "none"
    return "> 20 %" if math.isinf(advice.tolerable_drop) else f"{100 * advice.tolerable_drop:.1f} %"


def count_unsafe(programs: Sequence[ProgramAdvice]) -> dict[str, int]:
    """Count the programs of each kind that may not be run."""
    words = Counter(program.verdict.stability for program in programs)
    return {
        "unstable": words[Stability.NOT_STABLE],
        "doubtful": words[Stability.DOUBTFUL],
        "not_checked": words[Stability.UNKNOWN],
        "beyond_drive": sum(program.verdict.is_beyond_drive for program in programs),
    }


def check_summary_text(programs: Sequence[ProgramAdvice], others: int) -> str:
    """Return how many programs have each verdict, and how many have no speed or depth."""
    words = Counter(program.verdict.stability for program in programs)
    texts = [f"{words[word]} {word}" for word in Stability if words[word]]
    beyond = count_unsafe(programs)["beyond_drive"]
    texts += [f"{beyond} beyond the drive"] if beyond else []
    texts += [f"{others} without a speed or a depth"] if others else []
    return f"{count_noun(len(programs) + others, 'program')}: {', '.join(texts)}"


def advice_lines(program: ProgramAdvice, machine: Machine) -> Iterator[str]:
    """Return what is wrong with a program and what to do, a line for each."""
    verdict = program.verdict
    name = verdict.program.name
    if worded := [remark for remark in verdict.remarks if remark.code in NO_LIMIT_CODES]:
        yield from map(str, worded)
    elif verdict.stability is Stability.NOT_STABLE:
        yield f"{name}: {_chatter_text(program)}; {_alternative_text(program, machine)}"
    elif verdict.stability is Stability.DOUBTFUL:
        settles = [remark for remark in verdict.remarks if remark.code == "doubt-decides"]
        texts = [f"{remark.text}; to settle it: {remark.cure}" for remark in settles]
        yield f"{name}: {'; '.join([*texts, *_interim_texts(program, machine)])}"
    if verdict.is_beyond_drive:
        yield f"{name}: [drive] allows no more than {_floor_depth_text(verdict.drive_limit)} mm at this speed"


def _chatter_text(program: ProgramAdvice) -> str:
    verdict = program.verdict
    word = "period-two chatter" if verdict.kind == "flip" else "chatter"
    where = f" near {verdict.chatter_frequency:.0f} Hz" if math.isfinite(verdict.chatter_frequency) else ""
    text = f"{word}{where}{worst_feed_text(verdict)}"
    return f"stable at first, no longer: {text}" if program.is_no_longer_stable else text


def worst_feed_text(verdict: Verdict) -> str:
    """Return the feed direction with the lowest limit where it matters."""
    limits = np.ones(1) if verdict.samples is None else verdict.samples.limits
    if np.max(limits) <= MIN_FEED_RATIO * np.min(limits):
        return ""
    degrees = round(math.degrees(verdict.feed_angle))
    return f", worst fed along {({0: 'x', 90: 'y'}).get(degrees, f'{degrees} degrees from x')}"


def _interim_texts(program: ProgramAdvice, machine: Machine) -> Iterator[str]:
    """Return what to do until the verdict is settled; open measurements come first."""
    verdict = program.verdict
    if verdict.assembly is not None and is_compliance_known(verdict.program, verdict.assembly):
        yield f"until then {_alternative_text(program, machine)}"


def _alternative_text(advice: ProgramAdvice, machine: Machine) -> str:
    verdict, best, shallower = advice.verdict, advice.advice.best, advice.advice.deepest_here
    gap = None if verdict.assembly is None else find_open_question(verdict.program, verdict.assembly)
    if gap is not None:
        return f"{gap[1]}: only then can a safe speed be named"
    reach = _speed_range_text(CutRange.of(machine, verdict.program))
    if best is None:
        return f"no safe speed {reach}; choose another tool"
    if best.depth_mm == verdict.program.depth_mm:
        return f"run this depth at {format_rpm(best.speed_rpm)} rpm {robustness_text(best)}"
    texts = [f"no safe speed for this depth {reach}"]
    if not _is_same_setting(best, shallower):
        texts.append(f"most chips: {best.depth_mm:g} mm at {format_rpm(best.speed_rpm)} rpm {robustness_text(best)}")
    if shallower is not None:
        depth, speed = f"{shallower.depth_mm:g}", format_rpm(shallower.speed_rpm)
        texts.append(f"at {speed} rpm no deeper than {depth} mm {robustness_text(shallower)}")
    return "; ".join(texts)


def _speed_range_text(reach: CutRange) -> str:
    """Return the range of speeds that was searched."""
    if reach.is_empty:
        return "that the tool bears"
    return f"in {format_rpm(reach.low_rpm)} to {format_rpm(reach.high_rpm)} rpm"


def _is_same_setting(best: Setting, shallower: Setting | None) -> bool:
    return shallower is not None and (best.speed_rpm, best.depth_mm) == (shallower.speed_rpm, shallower.depth_mm)


def _floor_depth_text(depth: float) -> str:
    """Return a depth (m) in mm, rounded down to two decimals."""
    return f"{math.floor(depth * 1e5) / 100:.2f}"


SETTING_FIELDS = json_fields("speed_rpm depth_mm window_rpm depth_margin frequency_left=drop_margin")


def setting_json(setting: Setting | None) -> dict[str, Any] | None:
    """Return a recommended speed and depth with its robustness."""
    return None if setting is None else SETTING_FIELDS(setting)


def format_rpm(speed: float) -> str:
    """Return a speed in groups of three digits."""
    return f"{speed:,.10g}".replace(",", " ")


def robustness_text(setting: Setting) -> str:
    """Return the margins of a setting in speed, depth and frequency, rounded down."""
    low, high = setting.window_rpm
    margin = f"{math.floor(100 * setting.depth_margin + 1e-6)} % of depth to spare"
    return (
        f"({format_rpm(low)} to {format_rpm(high)} rpm is safe; {margin}; {_frequency_drop_text(setting.drop_margin)})"
    )


def _frequency_drop_text(fall: float) -> str:
    if fall <= 0:
        return f"the frequency may fall by less than {100 * CHECKED_DROPS[1]:g} %"
    return f"the frequency may fall by {100 * fall:.3g} %" + (" or more" if fall >= CHECKED_DROPS[-1] else "")
