"""The first screen of the report: light, what changed, which programs until when, what instead, when to tap."""

from __future__ import annotations

import math
from datetime import datetime, timedelta
from typing import Any

from acquisition import Remark, joined
from lobewatch.decay import SeriesStanding, Standing
from lobewatch.decay.light import LIGHTS, Light
from lobewatch.decay.reach import NOBODY_KNOWS, Fate
from lobewatch.machine import Machine
from lobewatch.show.programs.describe_advice import ProgramAdvice, rpm
from lobewatch.show.programs.describe_verdicts import WORDS
from lobewatch.show.report.first_pictures import first_pictures
from lobewatch.show.report.gauge import gauge
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.terminal.light_words import light_kind, light_word
from lobewatch.show.trends.describe_trend import change_text, course_text, no_dates_text, rate_text, reach_text
from lobewatch.verdicts import Word

UNTOLD = Fate(NOBODY_KNOWS, NOBODY_KNOWS)
FEW = 3
"""Reasons, and series, on the first screen; the others stand below it."""
IN_TABLES = (
    *("frequency-alarm", "frequency-warn", "decay"),
    *("program-not-stable", "program-doubtful", "program-unknown"),
    "overdue",
)
"""Reasons that stand on the first screen as a series, a program or a date, unless they are the first."""


def first_screen(material: ReportMaterial) -> dict[str, Any]:
    """What the first screen shows, as the template takes it."""
    standing, limits = material.outlook.standing, material.machine.limits
    worst = standing.series[0]
    return {
        **_light(standing),
        "gauge": gauge(worst.fall.value, limits.frequency_warn_percent, limits.frequency_alarm_percent)
        if _has_changed(worst)
        else None,
        "series": [_series(series) for series in standing.series[:FEW]],
        "more_series": len(standing.series[FEW:]),
        "programs": [_program(program, material) for program in material.programs],
        "no_dates": no_dates_text(material.outlook),
        "tap": _tap(standing, material.machine),
        "pictures": list(first_pictures(material)),
    }


def _light(standing: Standing) -> dict[str, Any]:
    """The light in words, the reasons, the next step."""
    first, others = _reasons(standing)
    shown = [remark for remark in others if LIGHTS[remark.code] is not Light.GOOD][: FEW - 1]
    return {
        "light": light_word(standing.light, standing.is_early),
        "kind": light_kind(standing.light, standing.is_early),
        "reasons": [remark.finding for remark in [*first, *shown]],
        "others": [remark.finding for remark in others if remark not in shown],
        "next_step": standing.next_step,
    }


def _reasons(standing: Standing) -> tuple[list[Remark], list[Remark]]:
    """The worst, of the series that fell most; those beside it that nothing else of the first screen shows."""
    plain, order = set(standing.reasons), {series.name: place for place, series in enumerate(standing.series)}
    alike = [remark for remark in standing.remarks if remark.code == standing.remarks[0].code]
    first = joined(sorted(alike, key=lambda remark: order.get(remark.about, 0)))[:1]
    beside = [remark for remark in standing.remarks if remark.code not in IN_TABLES or remark not in plain]
    return first, [remark for remark in joined(beside) if remark not in first]


def _has_changed(series: SeriesStanding) -> bool:
    return series.fall.is_known and not series.is_first


def _series(series: SeriesStanding) -> dict[str, str]:
    """Name, change, course and rate; of an only test, that it is the first."""
    if series.is_first:
        return {"name": series.name, "change": "first test", "course": "nothing to compare it with yet"}
    trend = series.trend
    course = [] if trend is None else [*filter(None, (course_text(trend), rate_text(trend)))]
    since = f"since {series.first:%Y-%m-%d}"
    return {"name": series.name, "change": change_text(series), "course": "; ".join(course) or since}


def _program(program: ProgramAdvice, material: ReportMaterial) -> dict[str, str]:
    name, word, outlook = program.verdict.program.name, program.verdict.word, material.outlook
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
