"""Show verdicts on cutting programs and the uncertainty they were evaluated for."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from rich.markup import escape
from rich.table import Table

from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.arrays import Floats
from lobewatch.logbook import Logbook
from lobewatch.machine import Machine, SpeedTable, UncertaintyTable
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement.chain_check import find_weakest_check
from lobewatch.measurement.tap_age import format_age
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, new_table, remark_lines
from lobewatch.show.terminal.sentences import wrap_lines
from lobewatch.tool import Assembly
from lobewatch.tool.tap_series import MIN_TAPS_FOR_SCATTER
from lobewatch.verdicts import SpindleAtSpeed, Stability, Verdict
from lobewatch.verdicts.monte_carlo import TRIED_LIMIT_SHARES
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty
from lobewatch.verdicts.uncertainty_causes import CLAMPING, UNCERTAINTY_CAUSES

NOT_ROTATING_TEXTS = (
    "Limits in the table are for the spindle as tapped, not rotating.",
    "The chatter risk is estimated for the rotating spindle, not measured.",
)
"""Notes on reading a table of verdicts."""
CHECK_HINT = "Causes and stable settings: lobewatch check"
"""Next step below a table with verdicts other than stable."""
FROM_MACHINE_FILE = "machine.toml"
DEGREES_PER_RADIAN = 180 / np.pi
MIN_SHOWN_WIDTH = 5e-5
"""Smallest half-width that is shown."""


def factor_text(name: str) -> str:
    """Return the name of a learned factor, such as "frequency in x, mode 2" for "frequency_x_2"."""
    if "_" not in name:
        return {"tangential": "Kt", "ratio": "Kr/Kt"}[name]
    quantity, direction, *mode = name.split("_")
    return f"{quantity} in {direction}" + (f", mode {mode[0]}" if mode else "")


def uncertainty_json(uncertainty: Uncertainty) -> JsonObject:
    """Return relative half-widths by cause (degrees for phases) of the modes in x, then y."""
    units = {"frequency": 1, "damping_ratio": 1, "stiffness": 1, "phase_deg": DEGREES_PER_RADIAN}
    columns = {cause: (widths * [*units.values()]).T.tolist() for cause, widths in uncertainty.modes.items()}
    modes = {cause: dict(zip(units, values, strict=True)) for cause, values in columns.items()}
    ranges = {"tangential": uncertainty.tangential, "radial_over_tangential": uncertainty.ratio}
    coefficients = {name: [factor.low - 1, factor.high - 1] for name, factor in ranges.items()}
    return modes | {"speed": uncertainty.speed, "coefficients": coefficients}


def tap_age_json(assembly: Assembly | None) -> int | None:
    """Return the age of the older of the newest tap tests in x and y, in whole days; None if unknown."""
    return None if assembly is None or assembly.age_days is None else int(assembly.age_days)


def tap_age_text(assembly: Assembly) -> str:
    """Return the date of the newest tap test, that of an older direction, and the age."""
    dates = [f"{time.astimezone():%Y-%m-%d}" for time in (assembly.time, assembly.tapped_since) if time is not None]
    age = [] if assembly.age_days is None else [format_age(assembly.age_days)]
    return f"Newest tap test: {', other direction: '.join(dict.fromkeys(dates))}" + "".join(f", {text}" for text in age)


def _tap_age_lines(verdicts: Sequence[Verdict]) -> list[str]:
    """Return a line on the newest tap test of each tool."""
    tools = {verdict.assembly.tool: verdict.assembly for verdict in verdicts if verdict.assembly is not None}
    texts = {tool: tap_age_text(assembly) for tool, assembly in tools.items()}
    return [f"{tool}: {text}" if len(tools) > 1 else text for tool, text in texts.items()]


def chain_json(assembly: Assembly | None) -> JsonObject | None:
    """Return the evidence for the sensors behind a tool and its date; None for a prediction."""
    check = None if assembly is None else find_weakest_check(assembly.chain_checks)
    if check is None:
        return None
    return {"checked_by": check.evidence, "date": check.date and check.date.isoformat()}


def _chain_lines(verdicts: Sequence[Verdict]) -> list[str]:
    """Return a line for each tool whose sensors are checked, with the evidence and its date."""
    tools = {verdict.assembly.tool: verdict.assembly for verdict in verdicts if verdict.assembly is not None}
    checks = {name: find_weakest_check(assembly.chain_checks) for name, assembly in tools.items()}
    known = dict.fromkeys(check.text for check in checks.values() if check is not None and check.evidence is not None)
    return [f"Sensor chain: {text}." for text in known]


def verdict_notes(verdicts: Sequence[Verdict], machine: Machine) -> list[str]:
    """Return the notes below a table of verdicts: the state of the spindle, then the uncertainty, one cause each."""
    named, evaluated, learned = dict[tuple[str, ...], list[str]](), 0, list[Verdict]()
    for verdict in verdicts:
        if verdict.samples is not None and verdict.assembly is not None:
            parts = _uncertainty_parts(verdict, verdict.samples.uncertainty, verdict.assembly, machine)
            named.setdefault(tuple(parts), []).append(verdict.program.name)
            evaluated += 1
            learned += [verdict] if verdict.n_cuts else []
    lines = [*_tap_age_lines(verdicts), *_chain_lines(verdicts)]
    lines += [*NOT_ROTATING_TEXTS, speed_drop_text(machine)] if len(learned) < evaluated else []
    lines += limits_at_speed_lines(verdicts)
    lines += [at_speed_text(learned)] if learned else []
    for causes, names in named.items():
        about = f"Uncertainty of {', '.join(names)}" if len(named) > 1 else "Uncertainty"
        lines += [f"{about} (docs/lobes.md):", *(f"  {cause}" for cause in causes)]
    return lines


def speed_drop_text(machine: Machine) -> str:
    """Return the note on the frequency drop that a stable verdict covers."""
    low, high = machine.speed.drop_percent
    source = "assumed" if machine.speed.drop_percent == SpeedTable().drop_percent else FROM_MACHINE_FILE
    return f"Stable covers a frequency drop at speed of {low:g} to {high:g} % ({source})."


def limits_at_speed_lines(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Yield one line with the lowest limit of each program over the frequency drop; none for learned ones."""
    texts = [
        f"{verdict.program.name} {limit_at_speed_text(verdict)}"
        for verdict in verdicts
        if not (verdict.n_cuts or math.isnan(verdict.limit_at_speed))
    ]
    if texts:
        yield f"Limit at speed, lowest over the frequency drop ({LENGTH.unit}): {', '.join(texts)}"


def at_speed_text(verdicts: Sequence[Verdict]) -> str:
    """Return the note on verdicts with test cuts."""
    names = ", ".join(verdict.program.name for verdict in verdicts)
    return f"{names}: valid for the rotating spindle, learned from {count_noun(verdicts[0].n_cuts, 'test cut')}"


def _uncertainty_parts(verdict: Verdict, doubt: Uncertainty, assembly: Assembly, machine: Machine) -> Iterator[str]:
    given = machine.doubt
    if verdict.n_cuts:
        yield from _learned_parts(verdict.at_speed, doubt.speed)
        return
    missing = "y" if "x" in assembly.directions else "x"
    lacking = "usable" if missing in assembly.unusable else "tapped"
    for name, widths in doubt.modes.items():
        label = UNCERTAINTY_CAUSES[name].label.format(direction=missing, lacking=lacking)
        if name == CLAMPING.name:
            yield from _reclamping_parts(widths, label, assembly, given)
        elif np.any(widths > MIN_SHOWN_WIDTH):
            yield f"{_widths_text(np.max(widths, axis=0))} {label}"
    if doubt.axes is not None and doubt.axes.sign_count:
        yield "modes with rotated principal directions (cross FRF not tapped)"
    source = f" ({FROM_MACHINE_FILE})" if given.speed_percent != UncertaintyTable().speed_percent else ""
    yield f"speed {_half_width_text(doubt.speed)}{source}"
    yield from _coefficient_parts(verdict, doubt, machine)


def _learned_parts(at_speed: SpindleAtSpeed, speed: float) -> Iterator[str]:
    before, after = at_speed.prior_ranges, at_speed.posterior_ranges
    for key in ("tangential", "ratio", *(name for name in before if name.startswith("frequency"))):
        prior, posterior = (f"{factor.low:.2f}..{factor.high:.2f}" for factor in (before[key], after[key]))
        yield f"{factor_text(key)} times {posterior} (times {prior} before the test cuts)"
    yield f"speed {_half_width_text(speed)}"


def _reclamping_parts(widths: Floats, label: str, assembly: Assembly, given: UncertaintyTable) -> Iterator[str]:
    asked, texts = (given.frequency_percent, given.damping_percent, given.stiffness_percent), dict[str, str]()
    for side in assembly.directions:
        scatter = f"scatter of {len(assembly.series.get(side, ()))} tests, outliers included"
        sources = [
            scatter if assembly.scatter(side) is not None else f"default value until {MIN_TAPS_FOR_SCATTER} tests"
        ]
        sources = [] if None not in asked else sources
        sources += [FROM_MACHINE_FILE] if any(wish is not None for wish in asked) else []
        width = widths[len(assembly.x or ()) if side == "y" else 0]
        texts[side] = f"{_widths_text(width)} {label} ({', '.join(sources)})"
    is_same = len(set(texts.values())) == 1
    yield from [*texts.values()][:1] if is_same else (f"{side}: {text}" for side, text in texts.items())


def _coefficient_parts(verdict: Verdict, uncertainty: Uncertainty, machine: Machine) -> Iterator[str]:
    coefficients = machine.coefficients(verdict.program)
    is_given = machine.doubt.coefficients_percent != UncertaintyTable().coefficients_percent
    source = f" ({FROM_MACHINE_FILE})" if is_given else ""
    if coefficients.tangential_range is not None:
        source = f" (published for {coefficients.alloy or coefficients.material})"
    tangential, ratio = _span_text(uncertainty.tangential), _span_text(uncertainty.ratio)
    is_same = uncertainty.tangential == uncertainty.ratio
    yield (f"Kt and Kr/Kt {tangential}" if is_same else f"Kt {tangential}, Kr/Kt {ratio}") + source


def _widths_text(widths: Floats) -> str:
    """Return half-widths of frequency, damping ratio, stiffness and phase, without negligible ones."""
    named = zip(("frequency", "damping", "stiffness"), widths[:3].tolist(), strict=True)
    texts = [f"{name} {_half_width_text(width)}" for name, width in named if width > MIN_SHOWN_WIDTH]
    texts += [f"phase ±{DEGREES_PER_RADIAN * widths[3]:.2g} deg"] if widths[3] > MIN_SHOWN_WIDTH else []
    return ", ".join(texts) or "nothing"


def _half_width_text(share: float) -> str:
    return f"±{100 * share:.2g} %" if share < 0.0995 else f"±{100 * share:.0f} %"


def _span_text(span: FactorRange) -> str:
    if np.isclose(1 - span.low, span.high - 1):
        return _half_width_text(span.high - 1)
    return f"{100 * (span.low - 1):+.0f}..{100 * (span.high - 1):+.0f} %"


class VerdictStyle(NamedTuple):
    """Style of a verdict."""

    symbol: str
    """Character that tells verdicts apart without color."""
    css_class: str
    """Class in the style sheet of the report."""
    style: str
    """Style in a terminal."""


VERDICT_STYLES: Mapping[Stability, VerdictStyle] = {
    Stability.STABLE: VerdictStyle("✓", "ok", "green"),
    Stability.DOUBTFUL: VerdictStyle("!", "doubt", "yellow"),
    Stability.NOT_STABLE: VerdictStyle("✗", "bad", "bold red"),
    Stability.UNKNOWN: VerdictStyle("?", "doubt", "bold"),
}
"""Style of each verdict, the same everywhere."""


def verdict_json(verdict: Verdict) -> JsonObject:
    """Return one verdict as a JSON object; unknown numbers are NaN or None."""
    program, samples, assembly = verdict.program, verdict.samples, verdict.assembly
    return {
        "name": program.name,
        "speed_rpm": program.speed_rpm,
        "depth_mm": program.depth_mm,
        "feed": program.feed,
        "tap_id": assembly.tap_id if assembly else "",
        "tap_age_days": tap_age_json(assembly),
        "stable": verdict.is_stable,
        "verdict": verdict.stability,
        "measured": verdict.is_measured,
        **limits_json(verdict),
        "depth_margin": verdict.depth_margin,
        "chance_turning": verdict.chatter_risk,
        "decided_by": verdict.decisive_cause or None,
        "sensor_chain": chain_json(assembly),
        "cuts": verdict.n_cuts,
        "chatter_frequency_hz": verdict.chatter_frequency,
        "kind": verdict.kind,
        "worst_feed_deg": math.degrees(verdict.feed_angle),
        "drive_limit_mm": verdict.drive_limit * 1e3,
        "doubt": None if samples is None else uncertainty_json(samples.uncertainty),
        "method": verdict.method,
        "method_detail": verdict.detail,
    }


def limits_json(verdict: Verdict) -> JsonObject:
    """Return the limits of one verdict, not rotating and at speed, as a JSON object."""
    drop = None if verdict.samples is None else verdict.samples.drop
    return {
        "limit_mm": verdict.limit * 1e3,
        "limit_low_mm": verdict.limit_low * 1e3,
        "limit_high_mm": verdict.limit_high * 1e3,
        "limit_at_speed_mm": verdict.limit_at_speed * 1e3,
        "drop_at_speed": None if drop is None else [drop.low, drop.high],
    }


def verdict_table(verdicts: Sequence[Verdict], margins: Sequence[str] = ()) -> Table:
    """Return a table with a line for each program; margins: f1 margin of each, if shown."""
    unit = LENGTH.unit
    headings = "~program", "speed\n(rpm)", f"ap\n({unit})", f"limit ({unit})\n98 % interval", "chatter\nrisk"
    table = new_table(*headings, *(["f1\nmargin"] if margins else []), "~verdict")
    for i, verdict in enumerate(verdicts):
        program = verdict.program
        numbers = (
            f"{program.speed_rpm:g}",
            LENGTH.number(program.depth_mm, "g"),
            limits_text(verdict),
            chatter_risk_text(verdict),
        )
        is_limited = verdict.stability is Stability.STABLE and verdict.is_beyond_drive
        style = "bold" if is_limited else VERDICT_STYLES[verdict.stability].style
        table.add_row(escape(program.name), *numbers, *margins[i : i + 1], f"[{style}]{verdict_text(verdict)}[/]")
    return table


def limits_text(verdict: Verdict) -> str:
    """Return the median limit (mm) with its band."""
    band = band_text(verdict)
    return limit_text(verdict) + (f" ({band})" if band else "")


def limit_at_speed_text(verdict: Verdict) -> str:
    """Return the lowest limit (mm) over the frequency drop at speed."""
    return "-" if math.isnan(verdict.limit_at_speed) else _depth_text(verdict.limit_at_speed, verdict)


def limit_text(verdict: Verdict) -> str:
    """Return the median limit (mm)."""
    return "-" if math.isnan(verdict.limit) else _depth_text(verdict.limit, verdict)


def band_text(verdict: Verdict) -> str:
    """Return the band of the limit (mm); empty where it is unknown or beyond the search."""
    if math.isnan(verdict.limit_low) or math.isinf(verdict.limit_low):
        return ""
    return f"{_depth_text(verdict.limit_low, verdict)}..{_depth_text(verdict.limit_high, verdict)}"


def chatter_risk_text(verdict: Verdict) -> str:
    """Return the chatter risk with the spindle rotating."""
    if math.isnan(verdict.chatter_risk):
        return "-"
    percent = round(100 * verdict.chatter_risk)
    return {0: "< 1 %", 100: "> 99 %"}.get(percent, f"{percent} %")


EVEN_CHANCE, NEAR_CERTAINTY = 0.55, 0.95
"""Chances from which words count tenths, and call an event almost certain."""
WORDED_CHANCES = (2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 70, 100)
"""Numbers N of the words "about 1 in N"; the last bounds a chance of which no sample is evidence."""


def chance_text(chance: float) -> str:
    """Return a chance in words, such as "about 1 in 50"; "unknown" for NaN."""
    if math.isnan(chance):
        return "unknown"
    if chance * WORDED_CHANCES[-1] < 1:
        return f"less than 1 in {WORDED_CHANCES[-1]}"
    if chance >= EVEN_CHANCE:
        return "almost certain" if chance >= NEAR_CERTAINTY else f"about {min(round(10 * chance), 9)} in 10"
    return f"about 1 in {min(WORDED_CHANCES, key=lambda number: abs(math.log(number * chance)))}"


def margin_text(verdict: Verdict) -> str:
    """Return the margin of a program in depth."""
    return f"{100 * verdict.depth_margin:+.0f} %" if math.isfinite(verdict.depth_margin) else "-"


def verdict_text(verdict: Verdict) -> str:
    """Return the verdict, with "beyond the drive" and "(predicted)" if they apply."""
    is_evaluated = verdict.stability is not Stability.UNKNOWN and verdict.assembly is not None
    predicted = is_evaluated and not verdict.is_measured
    words = [verdict.stability.value, *(["beyond the drive"] if verdict.is_beyond_drive else [])]
    return ", ".join(words) + (" (predicted)" if predicted else "")


def is_safe(verdict: Verdict) -> bool:
    """Return whether a program may be run: stable, and within the drive limits."""
    return verdict.stability is Stability.STABLE and not verdict.is_beyond_drive


def _depth_text(depth: float, verdict: Verdict) -> str:
    mm = 1e3 * (_searched_depth(verdict) if math.isinf(depth) else depth)
    digits = 2 if mm < 99.995 else 1 if mm < 999.95 else 0
    return f"{'> ' if math.isinf(depth) else ''}{LENGTH.number(mm, f'.{digits}f')}"


def _searched_depth(verdict: Verdict) -> float:
    """Return the depth (m) up to which every sample was searched."""
    if math.isinf(verdict.limit) or verdict.samples is None:
        return MAX_PROGRAM_DEPTH_RATIO * verdict.program.depth_mm / 1e3
    force = verdict.samples.rows.tangential
    return float(np.min(force[0] / force)) * float(TRIED_LIMIT_SHARES[-1]) * verdict.limit


def program_texts(logbook: Logbook) -> Texts:
    """Return the verdicts on all programs, the next command, and the remarks on the files."""
    verdicts = logbook.verdicts()
    notes = wrap_lines(verdict_notes(verdicts, logbook.machine), "")
    texts: Texts = [verdict_table(verdicts), *notes] if verdicts else []
    if not all(map(is_safe, verdicts)):
        texts.append(CHECK_HINT)
    return [*texts, *remark_lines(logbook.remarks)]
