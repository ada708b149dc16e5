"""Show verdicts with advice, for `lobewatch check` and the report, and stability lobes with recommended pockets."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from rich.table import Table

from acquisition import Remark, merge_remarks
from acquisition.errors import join_sentences
from lobes import PocketShift, StabilityLobes
from lobewatch.logbook import Analysis, LobeComparison, Logbook
from lobewatch.logbook.chart_data import NO_POCKET_CODE
from lobewatch.machine import REFERENCE_CUT, Machine
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.show.programs.verdicts import (
    at_speed_text,
    chance_text,
    limits_at_speed_lines,
    tap_age_json,
    tap_age_text,
    verdict_json,
    verdict_notes,
    verdict_table,
)
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, pick, remark_lines
from lobewatch.show.terminal.sentences import capitalize, wrap_lines
from lobewatch.verdicts import Advice, Setting, Stability, Verdict
from lobewatch.verdicts.setting_robustness import CHECKED_DROPS
from lobewatch.verdicts.verdict import StoredVerdict, find_open_question, is_compliance_known

NO_LIMIT_CODES = ("not-checked", "heard-alone", "no-tap-test")
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


def advise_program(logbook: Logbook | Analysis, verdict: Verdict) -> ProgramAdvice:
    """Return one program with its verdict and advice."""
    return ProgramAdvice(verdict, logbook.advice(verdict), logbook.initial_verdict(verdict))


def setting_json(setting: Setting) -> JsonObject:
    """Return a recommended speed and depth with its robustness."""
    named = pick(setting, "speed_rpm", "depth_mm", "window_rpm", "depth_margin")
    return named | {"frequency_left": setting.drop_margin, "chance_turning": setting.chatter_risk}


def _advice_json(program: ProgramAdvice) -> JsonObject:
    best, here, first = program.advice.best, program.advice.deepest_here, program.first_verdict
    return {
        **verdict_json(program.verdict),
        "was_stable_at_first": first and first.is_stable,
        "verdict_at_first": first and first.stability,
        "advice": best and setting_json(best),
        "advice_here": here and setting_json(here),
        "tolerable_decay": program.advice.tolerable_drop,
        "remarks": program.remarks,
    }


def check_json(programs: Sequence[ProgramAdvice], remarks: Sequence[Remark]) -> JsonObject:
    """Return all programs with advice, and how many may not be run; remarks: on the files."""
    return {"programs": list(map(_advice_json, programs)), **count_unsafe(programs), "remarks": remarks}


def check_texts(programs: Sequence[ProgramAdvice], remarks: Sequence[Remark], machine: Machine) -> Texts:
    """Return all programs in words: the table, a list of advice for each, and notes on reading them."""
    margins = [frequency_margin_text(program.advice) for program in programs]
    verdicts, about = [program.verdict for program in programs], chain(*(program.remarks for program in programs))
    texts: Texts = [verdict_table(verdicts, margins)]
    for program in programs:
        if items := advice_items(program, machine):
            texts += [f"{program.verdict.program.name}:", *wrap_lines(items)]
    shown = [*remarks, *(remark for remark in about if remark.code not in LINE_REMARK_CODES)]
    return [*texts, *wrap_lines(verdict_notes(verdicts, machine), ""), *wrap_lines(remark_lines(shown), "")]


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
    keys = {"unstable": Stability.NOT_STABLE, "doubtful": Stability.DOUBTFUL, "not_checked": Stability.UNKNOWN}
    beyond = sum(program.verdict.is_beyond_drive for program in programs)
    return {key: words[word] for key, word in keys.items()} | {"beyond_drive": beyond}


def check_summary_text(programs: Sequence[ProgramAdvice], others: int) -> str:
    """Return how many programs have each verdict, and how many have no speed or depth."""
    words = Counter(program.verdict.stability for program in programs)
    texts = [f"{words[word]} {word}" for word in Stability if words[word]]
    beyond = count_unsafe(programs)["beyond_drive"]
    texts += [f"{beyond} beyond the drive"] if beyond else []
    texts += [f"{others} without a speed or a depth"] if others else []
    return f"{count_noun(len(programs) + others, 'program')}: {', '.join(texts)}"


def advice_lines(program: ProgramAdvice, machine: Machine) -> Iterator[str]:
    """Return the advice on a program as one line of sentences; none for a stable one."""
    if items := advice_items(program, machine):
        yield f"{program.verdict.program.name}: {join_sentences(*items)}"


def advice_items(program: ProgramAdvice, machine: Machine) -> list[str]:
    """Return the advice on a program as a list, what to do first; empty for a stable one."""
    verdict, items = program.verdict, list[str]()
    if worded := [remark for remark in verdict.remarks if remark.code in NO_LIMIT_CODES]:
        items = [capitalize(text) for remark in worded for text in (remark.cure, remark.text) if text]
    elif verdict.stability is Stability.NOT_STABLE:
        items = [*_alternative_items(program, machine), *_chatter_items(program)]
    elif verdict.stability is Stability.DOUBTFUL:
        settles = [remark for remark in verdict.remarks if remark.code == "doubt-decides"]
        items = [capitalize(text) for remark in settles for text in (remark.cure, remark.text) if text]
        if verdict.assembly is not None and is_compliance_known(verdict.program, verdict.assembly):
            first, *others = _alternative_items(program, machine)  # open measurements come first
            items += [f"Until the verdict is clear, {first[:1].lower()}{first[1:]}", *others]
    if verdict.is_beyond_drive:
        deepest = LENGTH.text_at_most(math.floor(verdict.drive_limit * 1e5) / 100, ".2f")
        items.append(f"Drive limit: cut no deeper than {deepest} at this speed, or correct [drive] in machine.toml")
    return items


def _chatter_items(program: ProgramAdvice) -> Iterator[str]:
    verdict = program.verdict
    word = "Period-two chatter" if verdict.kind == "flip" else "Chatter"
    place = f" near {verdict.chatter_frequency:.0f} Hz" if math.isfinite(verdict.chatter_frequency) else ""
    yield f"{word}{place}{worst_feed_text(verdict)}"
    if program.first_verdict and program.first_verdict.stability is Stability.STABLE:
        yield "Stable at the first tap tests"


def worst_feed_text(verdict: Verdict) -> str:
    """Return the feed direction with the lowest limit if it matters."""
    limits = np.ones(1) if verdict.samples is None else verdict.samples.limits
    if np.max(limits) <= MIN_FEED_RATIO * np.min(limits):
        return ""
    degrees = round(math.degrees(verdict.feed_angle))
    return f", lowest limit with feed along {({0: 'x', 90: 'y'}).get(degrees, f'{degrees} degrees from x')}"


def _alternative_items(advice: ProgramAdvice, machine: Machine) -> list[str]:
    """Return the settings to use instead of a program, or the reason why there are none."""
    verdict, best, shallower = advice.verdict, advice.advice.best, advice.advice.deepest_here
    gap = None if verdict.assembly is None else find_open_question(verdict.program, verdict.assembly)
    if gap is not None:
        return [capitalize(gap[1]), f"No recommended setting yet: {gap[0]}"]
    cut_range = CutRange.of(machine, verdict.program)
    reach = f"from {format_rpm(cut_range.low_rpm)} to {format_rpm(cut_range.high_rpm)} rpm"
    reach = "within the tool limits" if cut_range.is_empty else reach
    if best is None:
        return ["Choose another tool", f"No stable speed {reach}"]
    if best.depth_mm == verdict.program.depth_mm:
        return [f"Run this depth at {format_rpm(best.speed_rpm)} rpm, {window_text(best)}", *margin_items(best)]
    items = list[str]()
    if shallower is None or (best.speed_rpm, best.depth_mm) != (shallower.speed_rpm, shallower.depth_mm):
        items.append(
            f"Run {LENGTH.text_at_most(best.depth_mm)} at {format_rpm(best.speed_rpm)} rpm, {window_text(best)}"
        )
        items += [f"Highest removal rate, {margins_text(best).lower()}", risk_text(best)]
    if shallower is not None:
        cut = "Or cut" if items else "Cut"
        items.append(f"{cut} at most {LENGTH.text_at_most(shallower.depth_mm)} at this speed, {window_text(shallower)}")
        items += margin_items(shallower)
    return [*items, f"No stable speed for this depth {reach}"]


def format_rpm(speed: float) -> str:
    """Return a speed in groups of three digits."""
    return f"{speed:,.10g}".replace(",", " ")


def window_text(setting: Setting) -> str:
    """Return the stable speeds around a setting."""
    return "stable from {} to {} rpm".format(*map(format_rpm, setting.window_rpm))


def margin_items(setting: Setting) -> list[str]:
    """Return the margins of a setting and its chance of chatter at speed."""
    return [margins_text(setting), risk_text(setting)]


def risk_text(setting: Setting) -> str:
    """Return the chance of chatter at speed in words."""
    return f"Chance of chatter at speed: {chance_text(setting.chatter_risk)}"


def margins_text(setting: Setting) -> str:
    """Return the margins of a setting in depth and frequency, rounded down."""
    margin = f"Depth margin (not rotating) {math.floor(100 * setting.depth_margin + 1e-6)} %"
    if setting.drop_margin <= 0:
        return f"{margin}, not stable if f1 drops another {100 * CHECKED_DROPS[1]:g} %"
    more = " or more" if setting.drop_margin >= CHECKED_DROPS[-1] else ""
    return f"{margin}, still stable if f1 drops another {100 * setting.drop_margin:.3g} %{more}"


def lobes_json(name: str, lobes: StabilityLobes) -> JsonObject:
    """Return the method and the lowest point of a diagram."""
    low = lobes.minimum
    lowest = {"minimum_depth_mm": low.depth * 1e3, "at_speed_rpm": low.speed_rpm}
    lowest |= {"chatter_frequency_hz": low.chatter_frequency}
    return {"cut": name, "method": lobes.method, "method_detail": lobes.detail} | lowest


def comparison_json(comparison: LobeComparison, remarks: Sequence[Remark]) -> JsonObject:
    """Return the newest diagram, its pockets, and the verdicts on the programs with this cut."""
    now, lobes = comparison.now, comparison.now.lobes
    return {
        **lobes_json(now.name, lobes),
        "tap_id": now.assembly.tap_id,
        "tap_age_days": tap_age_json(now.assembly),
        "source": now.source,
        "speed_rpm": lobes.speed_rpm,
        "depth_mm": lobes.depth * 1e3,
        "chatter_frequencies_hz": lobes.chatter_frequency,
        "kind": lobes.kind,
        "pockets": list(map(setting_json, comparison.pockets)),
        "pocket_shifts": list(map(_shift_json, comparison.shifts)),
        "programs": list(map(verdict_json, comparison.verdicts)),
        "remarks": merge_remarks(remarks),
    }


def _shift_json(shift: PocketShift) -> JsonObject:
    tips = {
        name: {"speed_rpm": tip.speed_rpm, "depth_mm": tip.depth * 1e3, **pick(tip, "from_rpm", "to_rpm")}
        for name, tip in (("then", shift.before), ("now", shift.after))
    }
    return tips | pick(shift, "speed_change", "depth_change")


def comparison_texts(comparison: LobeComparison, remarks: Sequence[Remark]) -> Texts:
    """Return the newest diagram in words, its pockets, and the verdicts on the programs with this cut."""
    now, verdicts, low = comparison.now, comparison.verdicts, comparison.now.lobes.minimum
    lowest = f"lowest limit {LENGTH.text(low.depth * 1e3, '.3f')} at {low.speed_rpm:.0f} rpm"
    origin = [f"computed from the {now.source} of {now.assembly.tap_id}", tap_age_text(now.assembly)]
    texts: Texts = [
        f"{'stated cut' if now.assembly.is_stated else now.name}: {now.lobes.method_text}",
        *(["computed from stated modes"] if now.assembly.is_stated else origin),
        f"{lowest}, chatter at {low.chatter_frequency:.1f} Hz"
        if math.isfinite(low.depth)
        else f"no stability limit in this speed range ({now.lobes.method_text})",
        *shift_lines(comparison.shifts),
    ]
    if comparison.pockets:
        heading = "Settings that stay stable at speed and until the next tap tests, highest removal rate first:"
        texts += [heading, pocket_table(comparison.pockets)]
    texts += [str(remark) for remark in remarks if remark.code == NO_POCKET_CODE]
    if verdicts:
        texts += [verdict_table(verdicts), *limits_at_speed_lines(verdicts)]
        methods = dict.fromkeys(verdict.method for verdict in verdicts if verdict.method)
        texts += [f"Verdicts computed by {method}, as in lobewatch check" for method in methods]
    if taught := [verdict for verdict in verdicts if verdict.n_cuts]:
        shown = "The diagram and its pockets are" if now.name == REFERENCE_CUT else "The diagram is"
        texts.append(join_sentences(at_speed_text(taught), f"{shown} for the spindle not rotating"))
    return [*texts, *remark_lines([remark for remark in remarks if remark.code != NO_POCKET_CODE])]


def pocket_table(pockets: Sequence[Setting]) -> Table:
    """Return a table with a line for each recommended pocket."""
    table = new_table(
        "speed (rpm)", "stable (rpm)", f"ap ({LENGTH.unit})", "depth\nmargin", "f1\nmargin", "chatter\nat speed"
    )
    for pocket in pockets:
        window = "{:.0f}..{:.0f}".format(*pocket.window_rpm)
        margin = f"{math.floor(100 * pocket.depth_margin + 1e-6)} %"
        drop = f"{100 * pocket.drop_margin:.0f} %{' or more' if pocket.drop_margin >= CHECKED_DROPS[-1] else ''}"
        table.add_row(
            f"{pocket.speed_rpm:.0f}",
            window,
            LENGTH.number(LENGTH.round_down(pocket.depth_mm), ".2f"),
            margin,
            drop,
            chance_text(pocket.chatter_risk),
        )
    return table


def shift_lines(shifts: Sequence[PocketShift]) -> Iterator[str]:
    """Return a line for each of the three fastest pockets that moved."""
    for shift in sorted(shifts, key=lambda shift: shift.before.speed_rpm, reverse=True)[:3]:
        before, after = shift.before, shift.after
        yield (
            f"pocket moved from {before.speed_rpm:.0f} to {after.speed_rpm:.0f} rpm ({100 * shift.speed_change:+.1f} %)"
            f", its depth from {LENGTH.number(before.depth * 1e3, '.2f')} to {LENGTH.text(after.depth * 1e3, '.2f')} "
            f"({100 * shift.depth_change:+.1f} %)"
        )
