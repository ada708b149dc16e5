"""The first screen of the report: light, what changed, which programs until when, what instead, when to tap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from acquisition import joined
from lobewatch.decay import SeriesStanding, Standing
from lobewatch.decay.reach import NOBODY_KNOWS, Fate
from lobewatch.logbook.outlook import Outlook
from lobewatch.machine import Machine
from lobewatch.show.programs.describe_advice import ProgramAdvice, rpm
from lobewatch.show.programs.describe_verdicts import WORDS
from lobewatch.show.terminal.light_words import light_kind, light_word
from lobewatch.show.trends.describe_trend import course_text, rate_text, reach_text, short_text
from lobewatch.verdicts import Word

UNTOLD = Fate(NOBODY_KNOWS, NOBODY_KNOWS)
FEW = 3
"""Reasons on the first screen; the others stand below it."""


def first_screen(outlook: Outlook, programs: Sequence[ProgramAdvice], machine: Machine) -> dict[str, Any]:
    """What the first screen shows, as the template takes it."""
    return {
        **light_of(outlook.standing),
        "changed": [_changed(series) for series in outlook.standing.series],
        "programs": [_program(program, outlook) for program in programs],
        "tap": _tap(outlook.standing, machine),
    }


def light_of(standing: Standing) -> dict[str, Any]:
    """The light in words, the reasons, the next step."""
    reasons = [remark.finding for remark in joined(standing.remarks)]
    return {
        "light": light_word(standing.light, standing.is_early),
        "kind": light_kind(standing.light, standing.is_early),
        "reasons": reasons[:FEW],
        "others": reasons[FEW:],
        "next_step": standing.next_step,
    }


def _changed(series: SeriesStanding) -> str:
    text = f"{series.name}: {short_text(series)}, {series.first:%Y-%m-%d}"
    if series.trend is None or series.trend.rate is None:
        return text
    return f"{text}; {course_text(series.trend)}; {rate_text(series.trend)}"


def _program(program: ProgramAdvice, outlook: Outlook) -> dict[str, str]:
    name, word = program.verdict.program.name, program.verdict.word
    return {
        "name": name,
        "kind": WORDS[word].kind,
        "word": f"{WORDS[word].symbol} {word}",
        "until": _until(word, outlook.programs.get(name, UNTOLD), outlook.standing.time),
        "instead": instead_text(program),
    }


def _until(word: Word, fate: Fate, now: datetime) -> str:
    if word is Word.STABLE:
        return f"doubtful {reach_text(fate.doubtful, now)}"
    if word is Word.DOUBTFUL:
        return f"not stable {reach_text(fate.not_stable, now)}"
    return "not stable already" if word is Word.NOT_STABLE else "not known"


def instead_text(program: ProgramAdvice) -> str:
    """Speed and depth to go to, in a few words."""
    assembly, settings = program.verdict.assembly, (program.advice.best, program.advice.here)
    if program.verdict.word is Word.STABLE:
        return "as it is"
    if program.verdict.word is Word.UNKNOWN or assembly is None or not assembly.is_sure:
        return "not known: see below"
    texts = [f"{rpm(setting.speed_rpm)} rpm, {setting.depth_mm:g} mm" for setting in settings if setting is not None]
    return " or ".join(dict.fromkeys(texts)) or "no safe speed: another tool"


def _tap(standing: Standing, machine: Machine) -> str:
    left, last = standing.days_left, standing.last_tap
    if left is None or last is None:
        return "now: it was never tapped"
    due = f"{last + timedelta(days=math.floor(machine.machine.tap_interval_days)):%Y-%m-%d}"
    return f"now: overdue since {due}" if left < 0 else f"by {due}"
