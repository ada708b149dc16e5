"""Consistency of advice, pockets and recommendations, and their distance from the best stable setting.

Random machines and programs. The best is looked for here on a dense grid of speeds and depths, each judged by the
judge of the search; only what cannot pass it (the middle or a few draws chatter) is left out unjudged.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from random_milling import RandomMilling, random_case
from verdict_study import MACHINE, assembly, limit_mm, program

from lobes import build_milling_system, count_pieces, growth_rate, rows_at_speeds
from lobewatch.machine import ProgramTable
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import NO_TEST_CUTS, ProgramCase
from lobewatch.verdicts.program_samples import draw_samples, find_worst_limit
from lobewatch.verdicts.recommendation import advise, find_stable_pockets, recommend
from lobewatch.verdicts.setting_robustness import MIN_DEPTH_MARGIN, Setting, sweep_extremes
from lobewatch.verdicts.setting_search import SettingSearch
from lobewatch.verdicts.verdict import Stability, evaluate_program

STEP = 0.01
"""Relative step of the speeds of the dense grid."""
HARDEST = 24
"""Draws with the largest force on the softest mode: they say first that a setting cannot pass."""
DEEPER_STEP = 0.02
"""Least relative step of its depths."""


@dataclass
class Answers:
    """Counts, and shares of the best."""

    cuts: int = 0
    settings: int = 0
    """Different settings that were named."""
    contradictions: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    """Settings that are not called stable when they are entered."""
    shares: list[float] = field(default_factory=list)
    """Chips of the best that was found over those of the best on the dense grid."""
    seconds: list[float] = field(default_factory=list)
    """CPU time of each recommendation."""


def answers(numbers: range, seed: int, most_modes: int = 12, dense: bool = True) -> Answers:
    """Return the answers for random machines by number, without those that have no limit."""
    counts, rngs = Answers(), np.random.default_rng(seed).spawn(numbers.stop)
    for number in numbers:
        rng = rngs[number]
        milling = random_case(rng)
        limit = limit_mm(milling) if len(milling.x + milling.y) <= most_modes else math.inf
        if not math.isfinite(limit):
            continue
        table, tool = program(milling, max(DEPTH_STEP_MM, limit * rng.uniform(0.3, 2.5))), assembly(milling)
        ask_everywhere(counts, f"{seed}.{number}", table, tool)
        if dense and len(counts.shares) < counts.cuts:
            counts.shares.append(share_of_best(SettingSearch(ProgramCase(table, tool, MACHINE))))
            sys.stdout.write(
                f"{number} {_about(milling)} {counts.seconds[-1]:.1f} s, {counts.shares[-1]:.3f} of best\n"
            )
            sys.stdout.flush()
    return counts


def ask_everywhere(counts: Answers, name: str, table: ProgramTable, tool: Assembly) -> None:
    """Ask `check`, `lobes` and `recommend` of one cut."""
    verdict = evaluate_program(table, tool, MACHINE)
    if verdict.stability is Stability.UNKNOWN:
        return  # its depth is not plausible: `check` asks about it first
    advice, pockets = advise(verdict, MACHINE), find_stable_pockets(table, tool, MACHINE)
    begin = time.process_time()
    free = recommend(table, tool, MACHINE, NO_TEST_CUTS).setting
    counts.seconds.append(time.process_time() - begin)
    at_depth = recommend(table, tool, MACHINE, NO_TEST_CUTS, depth_mm=table.depth_mm).setting
    counts.cuts += 1
    for what, is_so in {
        "pockets and recommendation": bool(pockets) == (free is not None),
        "first pocket and recommendation": not pockets or pockets[0] == free,
        "advice and recommendation": verdict.stability is Stability.STABLE or (advice.best is None) == (free is None),
        "advice and recommendation at its depth": verdict.stability is Stability.STABLE
        or _has_depth(advice.best, table) == (at_depth is not None),
    }.items():
        counts.contradictions += [] if is_so else [f"{name}: {what}"]
    named = {
        (s.speed_rpm, s.depth_mm) for s in (free, at_depth, advice.best, advice.deepest_here, *pockets) if s is not None
    }
    counts.settings += len(named)
    for speed, depth in sorted(named):
        if evaluate_program(_at(table, speed, depth), tool, MACHINE).stability is not Stability.STABLE:
            counts.refused.append(f"{name}: {speed:g} rpm, {depth:g} mm")


def share_of_best(search: SettingSearch) -> float:
    """Chips of the best that the search finds over the most on the grid; 1 where neither finds anything."""
    chips = 0.0 if search.best is None else search.best.speed_rpm * search.best.depth_mm
    most = max([chips, *_deeper(search, chips)])
    return 1.0 if most == 0 else chips / most


def _deeper(search: SettingSearch, chips: float) -> Iterator[float]:
    """Chips of settings of the grid with ever more of them than so many (rpm mm)."""
    speeds, most = search.cut_range.speeds(STEP)[::-1], chips
    thinkable = _middle_is_calm(search, speeds, chips)
    for speed in speeds[thinkable].tolist():
        deepest = float(search.cut_range.depth_limits(np.array([speed]))[0])
        depth = (math.floor(most / speed / DEPTH_STEP_MM) + 1) * DEPTH_STEP_MM
        while depth <= deepest and _may_pass(search, speed, depth):
            if not isinstance(search.verify(speed, round(depth, 6)), Setting):
                break
            most = speed * depth
            yield most
            depth += max(DEPTH_STEP_MM, math.floor(DEEPER_STEP * depth / DEPTH_STEP_MM) * DEPTH_STEP_MM)


def _middle_is_calm(search: SettingSearch, speeds: np.ndarray, chips: float) -> np.ndarray:
    """Return whether the median is stable at speeds (rpm) and the depth of a chip rate, with margins."""
    depths = (np.floor(chips / speeds / DEPTH_STEP_MM) + 1) * DEPTH_STEP_MM * (1 + MIN_DEPTH_MARGIN) / 1e3
    calm = np.ones(speeds.size, dtype=bool)
    for vectors in search.case.spindle.principal_directions.sign_patterns:
        system = build_milling_system(search.case.spindle.x, search.case.spindle.y, vectors)
        for cut in search.case.cuts:
            rows = rows_at_speeds(system, cut, speeds[calm])
            grown = growth_rate(rows, depths[calm, np.newaxis], count_pieces(rows, float(np.max(depths))))[:, 0]
            calm[calm] = grown < 0
            if not np.any(calm):
                return calm
    return calm


def _may_pass(search: SettingSearch, speed: float, depth_mm: float) -> bool:
    """Return whether the median and the critical samples allow a setting."""
    at = search.case.with_changes(speed_rpm=speed, depth_mm=depth_mm)
    worst = find_worst_limit(at)
    if worst.limit.limit < (1 + MIN_DEPTH_MARGIN) * at.depth:
        return False
    drawn = draw_samples(at, worst).with_lowest_cuts(np.inf, 2)
    force = drawn.rows.tangential[:, np.newaxis] / (drawn.rows.stiffness * drawn.rows.damping_ratio)
    swept = sweep_extremes(drawn, search.needed_drop, search.stiffness_at)
    hardest = np.argsort(-np.max(force, axis=1))[:HARDEST]
    few = np.add.outer(np.arange(0, len(swept.rows), len(drawn.rows)), hardest).ravel()
    return not np.any(swept[few].growth(at.depth) >= 0)


def _at(table: ProgramTable, speed: float, depth_mm: float) -> ProgramTable:
    fields = {name: getattr(table, name) for name in table.__struct_fields__}
    return ProgramTable(**fields | {"speed_rpm": speed, "depth_mm": depth_mm})


def _has_depth(setting: Setting | None, table: ProgramTable) -> bool:
    return setting is not None and setting.depth_mm == table.depth_mm


def _about(milling: RandomMilling) -> str:
    return f"{len(milling.x)}+{len(milling.y)} modes, {milling.teeth} teeth, a/D {milling.immersion}"


def summary(counts: Answers) -> str:
    """One line for docs/studies/long-tests.md."""
    shares = np.array(counts.shares or [np.nan])
    return (
        f"{counts.cuts} cuts, {counts.settings} settings, {len(counts.contradictions)} contradictions, "
        f"{len(counts.refused)} refused; found over best: 95 % in {np.mean(shares >= 0.95):.0%}, "
        f"least {np.min(shares):.2f}; CPU median {np.median(counts.seconds):.2f}, most {np.max(counts.seconds):.2f} s\n"
        + "\n".join([*counts.contradictions, *counts.refused])
    )


if __name__ == "__main__":
    seed, begin, end, most = map(int, sys.argv[1:])
    sys.stdout.write(summary(answers(range(begin, end), seed, most)) + "\n")
