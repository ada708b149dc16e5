"""Show the next ordinary cuts of a program, and the purpose of each."""

import math
import shlex
from collections.abc import Iterator
from pathlib import Path

from lobewatch.cuts.learning.production_ladder import MAX_CUT_RISK, LadderStep
from lobewatch.logbook.production import ProductionPlan
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.show.cuts.suggested_cuts import observe_command, question_lines
from lobewatch.show.programs.advice import format_rpm
from lobewatch.show.programs.verdicts import chance_text
from lobewatch.show.terminal.output import JsonObject
from lobewatch.verdicts import Setting


def ladder_json(plan: ProductionPlan | None, running: Setting | None) -> JsonObject | None:
    """Return the running setting and the next ordinary cuts; None if they are unknown."""
    if plan is None:
        return None
    now = running and {"speed_rpm": running.speed_rpm, "depth_mm": running.depth_mm}
    return {"now": now, "steps": _steps_json(plan), "asks": _asked_cut(plan)}


def next_step_json(plan: ProductionPlan | None) -> JsonObject:
    """Return the next ordinary cut after a cut."""
    steps = [] if plan is None else _steps_json(plan)
    return {"next_step": steps[0] if steps else None, "asks": None if plan is None else _asked_cut(plan)}


def _asked_cut(plan: ProductionPlan) -> str | None:
    return None if plan.ladder.questioned is None else plan.ladder.questioned.id


def _steps_json(plan: ProductionPlan) -> list[JsonObject]:
    return [
        {
            "speed_rpm": step.speed_rpm,
            "depth_mm": round(1e3 * step.depth, 6),
            "chance_of_chatter": step.chatter_probability,
            "expected_gain": step.gain if math.isfinite(step.gain) else None,
            "tells": ["verdict", "frequency"] if power is None else ["power", "verdict", "frequency"],
            "expected_power_kw": power,
        }
        for step, power in zip(plan.ladder.steps, plan.powers_kw, strict=True)
    ]


def ladder_lines(plan: ProductionPlan | None, folder: Path) -> Iterator[str]:
    """Return the next ordinary cuts, how to enter them, and the command for test cuts."""
    if plan is None:
        return
    if plan.ladder.steps:
        yield f"Next ordinary cuts, each with at most {100 * MAX_CUT_RISK:g} % chance of chatter:"
        steps = zip(plan.ladder.steps, plan.powers_kw, strict=True)
        for number, (step, power) in enumerate(steps, 1):
            yield f"  {number}. {_step_text(step, power)}"
        if len(plan.ladder.steps) > 1:
            shown = "" if plan.powers_kw[0] is None else " with the expected power"
            yield f"Cuts 2 and 3 follow if each cut before is stable{shown}"
    yield from _answer_lines(plan, folder)
    if plan.is_saved:
        program = shlex.join(["lobewatch", "suggest", str(folder), "--program", plan.learning.program.name])
        yield f"Faster, with test cuts that may chatter: {program}"
    else:
        yield "Save the cut with --save to enter results. Then lobewatch suggest also gives test cuts that may chatter."


def next_step_lines(plan: ProductionPlan | None, folder: Path) -> Iterator[str]:
    """Return the next ordinary cut after a cut, or that the best stable cut stays."""
    if plan is None:
        return
    if plan.ladder.steps:
        yield f"Next ordinary cut: {_step_text(plan.ladder.steps[0], plan.powers_kw[0])}"
    yield from _answer_lines(plan, folder)


def _step_text(step: LadderStep, power: float | None) -> str:
    gain = f", {100 * step.gain:.0f} % more removal rate" if 0 < step.gain < math.inf else ""
    shown = "" if power is None else f", {power:.2g} kW expected"
    chance = chance_text(step.chatter_probability)
    depth = LENGTH.text(1e3 * step.depth, ".4g")
    return f"{format_rpm(step.speed_rpm)} rpm, ap {depth} (chance of chatter {chance}{gain}{shown})"


def _answer_lines(plan: ProductionPlan, folder: Path) -> Iterator[str]:
    """Return the question about a stable cut, or how to enter the first step."""
    asked, program = plan.ladder.questioned, plan.learning.program
    if asked is not None:
        yield from question_lines(asked, program.name, folder)
    elif not plan.ladder.steps:
        yield f"No other cut removes more with at most {100 * MAX_CUT_RISK:g} % chance of chatter"
    elif plan.is_saved:
        step, power = plan.ladder.steps[0], plan.powers_kw[0]
        observe = observe_command(folder, program.name, step.speed_rpm, 1e3 * step.depth)
        shown = "" if power is None else " --power KW"
        yield f"Enter the result: {observe} --stable{shown} (or --chatter --frequency HZ)"
        told = "" if power is None else "The power tells Kt. "
        yield f"{told}Stable or chatter tells the limit. A chatter frequency tells f1."
