"""Show verdicts on cutting programs and the uncertainty they were evaluated for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from lobes.floquet.program_limit import MAX_PROGRAM_DEPTH_RATIO
from lobewatch.logbook import Logbook
from lobewatch.machine import Machine, UncertaintyTable
from lobewatch.show.terminal.output import new_table, remark_lines
from lobewatch.tool import Assembly
from lobewatch.tool.tap_series import MIN_TAPS_FOR_SCATTER
from lobewatch.verdicts import Stability, Verdict
from lobewatch.verdicts.monte_carlo import TRIED_LIMIT_SHARES
from lobewatch.verdicts.spindle_at_speed import SpindleAtSpeed
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty
from lobewatch.verdicts.uncertainty_causes import CLAMPING, UNCERTAINTY_CAUSES

UNCERTAINTY_PAGE = "docs/lobes.md"
"""Page that says where the sizes come from."""
NOT_ROTATING_TEXT = (
    "The words hold for the spindle as tapped, at rest, and low..high for 98 % of the doubt. turning: chance of "
    "chatter once it turns and cuts, where frequency, damping, stiffness and cutting force may differ; plausible, not "
    "measured."
)
"""Sentences that a table of verdicts is read by."""
FROM_MACHINE_FILE = "machine.toml"
UNCERTAINTY_KEYS = "frequency", "damping_ratio", "stiffness", "phase_deg"
DEGREES_PER_RADIAN = 180 / np.pi
MIN_SHOWN_WIDTH = 5e-5
"""A smaller half-width is not told."""
FACTOR_NAMES = {
    "tangential": "Kt",
    "ratio": "Kr/Kt",
    "frequency_x": "frequency in x",
    "frequency_y": "frequency in y",
    "damping_x": "damping in x",
    "damping_y": "damping in y",
    "stiffness_x": "stiffness in x",
    "stiffness_y": "stiffness in y",
}
"""Terms of what test cuts teach, by the name of the factor; further modes of a direction: `factor_text`."""

Floats = NDArray[np.float64]


def factor_text(name: str) -> str:
    """Term of a factor: "frequency_x_2" is that of the second mode in x."""
    if name in FACTOR_NAMES:
        return FACTOR_NAMES[name]
    leading, place = name.rsplit("_", 1)
    return f"{FACTOR_NAMES[leading]}, mode {place}"


def uncertainty_json(verdict: Verdict) -> dict[str, Any] | None:
    """Relative half-widths by cause (degrees of phases), those of modes in x, then y; None where nothing was judged."""
    if verdict.samples is None:
        return None
    doubt = verdict.samples.uncertainty
    modes = {
        cause: dict(zip(UNCERTAINTY_KEYS, (widths * [1, 1, 1, DEGREES_PER_RADIAN]).T.tolist(), strict=True))
        for cause, widths in doubt.modes.items()
    }
    ends = {"tangential": doubt.tangential, "radial_over_tangential": doubt.ratio}
    return modes | {
        "speed": doubt.speed,
        "coefficients": {name: [span.low - 1, span.high - 1] for name, span in ends.items()},
    }


def verdict_notes(verdicts: Sequence[Verdict], machine: Machine) -> list[str]:
    """Lines below a table of verdicts: what the words mean, and the doubt; none where nothing was judged."""
    doubts = uncertainty_lines(verdicts, machine)
    judged = [verdict for verdict in verdicts if verdict.samples is not None and verdict.assembly is not None]
    taught = [verdict for verdict in judged if verdict.n_cuts]
    texts = ([NOT_ROTATING_TEXT] if len(taught) < len(judged) else []) + ([at_speed_text(taught)] if taught else [])
    return [*doubts, *texts] if doubts else []


def at_speed_text(taught: Sequence[Verdict]) -> str:
    """What the words mean where test cuts have taught."""
    names, cuts = ", ".join(verdict.program.name for verdict in taught), _cut_count_text(taught[0].at_speed)
    return f"{names}: the words hold for the spindle as it turns, from {cuts}, and low..high for 98 % of it"


def _cut_count_text(at_speed: SpindleAtSpeed) -> str:
    return f"{at_speed.n_cuts} cut{'s' if at_speed.n_cuts > 1 else ''}"


def uncertainty_lines(verdicts: Sequence[Verdict], machine: Machine) -> list[str]:
    """Doubt of the programs, a line for all that have it alike."""
    named: dict[str, list[str]] = {}
    for verdict in verdicts:
        if verdict.samples is not None and verdict.assembly is not None:
            parts = _uncertainty_parts(verdict, verdict.samples.uncertainty, verdict.assembly, machine)
            named.setdefault("; ".join(parts), []).append(verdict.program.name)
    about = {text: f"doubt of {', '.join(names)}" if len(named) > 1 else "doubt" for text, names in named.items()}
    return [f"{about[text]}: {text} ({UNCERTAINTY_PAGE})" for text in named]


def _uncertainty_parts(verdict: Verdict, doubt: Uncertainty, assembly: Assembly, machine: Machine) -> Iterator[str]:
    given, standard = machine.doubt, UncertaintyTable()
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
        yield "modes askew to either side (cross not tapped)"
    yield f"speed {_half_width_text(doubt.speed)}" + (
        f" ({FROM_MACHINE_FILE})" if given.speed_percent != standard.speed_percent else ""
    )
    yield from _coefficient_parts(verdict, doubt, machine)


def _learned_parts(at_speed: SpindleAtSpeed, speed: float) -> Iterator[str]:
    """Intervals before and after the cuts; speed: half-width of the spindle speed, relative."""
    cuts = _cut_count_text(at_speed)
    for key in ("tangential", "ratio", *(name for name in at_speed.prior_ranges if name.startswith("frequency"))):
        before, after = (
            f"{span.low:.2f}..{span.high:.2f}" for span in (at_speed.prior_ranges[key], at_speed.posterior_ranges[key])
        )
        name = factor_text(key)
        yield f"{name} x {after}, {before} before the {cuts}" if name == "Kt" else f"{name} x {after} ({before})"
    yield f"speed {_half_width_text(speed)}"


def _reclamping_parts(widths: Floats, label: str, assembly: Assembly, given: UncertaintyTable) -> Iterator[str]:
    """Scatter from tap test to tap test, once where both directions have it alike."""
    places = {"x": 0, "y": len(assembly.x or ())}
    texts = {}
    for side in assembly.directions:
        texts[side] = (
            f"{_widths_text(widths[places[side]])} {label} ({_scatter_source_text(assembly, side, given)})"
        )
    alike = len(set(texts.values())) == 1
    yield from list(texts.values())[:1] if alike else (f"in {side} {text}" for side, text in texts.items())


def _scatter_source_text(assembly: Assembly, side: str, given: UncertaintyTable) -> str:
    asked = (given.frequency_percent, given.damping_percent, given.stiffness_percent)
    scatter = f"scatter of {len(assembly.series.get(side, ()))} tests"
    source = scatter if assembly.scatter(side) is not None else f"default until {MIN_TAPS_FOR_SCATTER} tests"
    if all(wish is not None for wish in asked):
        return FROM_MACHINE_FILE
    return source if all(wish is None for wish in asked) else f"{source}, {FROM_MACHINE_FILE}"


def _coefficient_parts(verdict: Verdict, doubt: Uncertainty, machine: Machine) -> Iterator[str]:
    known = machine.coefficients(verdict.program)
    is_given = machine.doubt.coefficients_percent != UncertaintyTable().coefficients_percent
    source = f" ({FROM_MACHINE_FILE})" if is_given else ""
    if known.tangential_range is not None:
        source = f" (published for {known.alloy or known.material})"
    if doubt.tangential == doubt.ratio:
        yield f"Kt and Kr/Kt {_span_text(doubt.tangential)}{source}"
    else:
        yield f"Kt {_span_text(doubt.tangential)}, Kr/Kt {_span_text(doubt.ratio)}{source}"


def _widths_text(widths: Floats) -> str:
    """Half-widths of frequency, damping ratio, stiffness and phase; those that are next to nothing are left out."""
    named = zip(("frequency", "damping", "stiffness"), widths[:3].tolist(), strict=True)
    texts = [f"{name} {_half_width_text(width)}" for name, width in named if width > MIN_SHOWN_WIDTH]
    texts += [f"phase ±{DEGREES_PER_RADIAN * widths[3]:.2g} deg"] if widths[3] > MIN_SHOWN_WIDTH else []
    return ", ".join(texts) or "nothing"


def _half_width_text(width: float) -> str:
    return f"±{_percent_text(width)} %"


def _span_text(span: FactorRange) -> str:
    if np.isclose(1 - span.low, span.high - 1):
        return _half_width_text(span.high - 1)
    return f"{100 * (span.low - 1):+.0f}..{100 * (span.high - 1):+.0f} %"


def _percent_text(share: float) -> str:
    return f"{100 * share:.2g}" if share < 0.0995 else f"{100 * share:.0f}"


class VerdictStyle(NamedTuple):
    """How a word looks."""

    symbol: str
    """Character beside it, for those who do not see its colour."""
    css_class: str
    """Class in the report."""
    style: str
    """Style in a terminal."""


VERDICT_STYLES: Mapping[Stability, VerdictStyle] = {
    Stability.STABLE: VerdictStyle("✓", "ok", "green"),
    Stability.DOUBTFUL: VerdictStyle("!", "doubt", "yellow"),
    Stability.NOT_STABLE: VerdictStyle("✗", "bad", "bold red"),
    Stability.UNKNOWN: VerdictStyle("?", "doubt", "bold"),
}
"""The four words, everywhere: each is its own text."""
DROP_HEADING = "fall\nleft"
"""Heading of how far the frequency may fall."""
VERDICT_HEADINGS = (
    "~program",
    "speed\n(rpm)",
    "depth\n(mm)",
    "limit (mm)\nlow..high",
    "turning",
    DROP_HEADING,
    "~verdict",
)


def verdict_json(verdict: Verdict) -> dict[str, Any]:
    """One program; numbers that are not known are null."""
    return {
        "name": verdict.program.name,
        "speed_rpm": verdict.program.speed_rpm,
        "depth_mm": verdict.program.depth_mm,
        "feed": verdict.program.feed,
        "tap_id": verdict.assembly.tap_id if verdict.assembly else "",
        "stable": verdict.is_stable,
        "verdict": verdict.stability,
        "measured": verdict.is_measured,
        "limit_mm": verdict.limit * 1e3,
        "limit_low_mm": verdict.limit_low * 1e3,
        "limit_high_mm": verdict.limit_high * 1e3,
        "depth_margin": verdict.depth_margin,
        "chance_turning": verdict.chatter_risk,
        "decided_by": verdict.decisive_cause or None,
        "cuts": verdict.n_cuts,
        "chatter_frequency_hz": verdict.chatter_frequency,
        "kind": verdict.kind,
        "worst_feed_deg": math.degrees(verdict.feed_angle),
        "drive_limit_mm": verdict.drive_limit * 1e3,
        "doubt": uncertainty_json(verdict),
        "method": verdict.method,
        "method_detail": verdict.detail,
    }


def verdict_table(verdicts: Sequence[Verdict], left: Sequence[str] = ()) -> Table:
    """Programs, a line each; left: how far the frequency of each may fall, a column where it is given."""
    rows = new_table(*(heading for heading in VERDICT_HEADINGS if left or heading != DROP_HEADING))
    for i, verdict in enumerate(verdicts):
        program = verdict.program
        numbers = (f"{program.speed_rpm:g}", f"{program.depth_mm:g}", limits_text(verdict), chatter_risk_text(verdict))
        rows.add_row(escape(program.name), *numbers, *left[i : i + 1], _styled_verdict(verdict))
    return rows


def limits_text(verdict: Verdict) -> str:
    """The limit in the middle of the doubt (mm), and how low and high it may be."""
    band = band_text(verdict)
    return limit_text(verdict) + (f" ({band})" if band else "")


def limit_text(verdict: Verdict) -> str:
    """The limit in the middle of the doubt (mm)."""
    return "-" if math.isnan(verdict.limit) else _depth_text(verdict.limit, verdict)


def band_text(verdict: Verdict) -> str:
    """How low and high the limit may be (mm); empty where that is not known, or more than is looked at."""
    if math.isnan(verdict.limit_low) or math.isinf(verdict.limit_low):
        return ""
    return f"{_depth_text(verdict.limit_low, verdict)}..{_depth_text(verdict.limit_high, verdict)}"


def chatter_risk_text(verdict: Verdict) -> str:
    """Chance of chatter once the spindle turns."""
    if math.isnan(verdict.chatter_risk):
        return "-"
    percent = round(100 * verdict.chatter_risk)
    return {0: "< 1 %", 100: "> 99 %"}.get(percent, f"{percent} %")


def margin_text(verdict: Verdict) -> str:
    """The margin of a program in depth."""
    return f"{100 * verdict.depth_margin:+.0f} %" if math.isfinite(verdict.depth_margin) else "-"


def verdict_text(verdict: Verdict) -> str:
    """The word, with what must be said in the same breath."""
    predicted = verdict.stability is not Stability.UNKNOWN and not verdict.is_measured
    words = [verdict.stability.value, *(["beyond the drive"] if verdict.is_beyond_drive else [])]
    return ", ".join(words) + (" (predicted)" if predicted else "")


def is_safe(verdict: Verdict) -> bool:
    """Whether it may be run: stable, and not beyond the drive."""
    return verdict.stability is Stability.STABLE and not verdict.is_beyond_drive


def _styled_verdict(verdict: Verdict) -> str:
    style = (
        VERDICT_STYLES[verdict.stability].style
        if is_safe(verdict) or verdict.stability is not Stability.STABLE
        else "bold"
    )
    return f"[{style}]{verdict_text(verdict)}[/]"


def _depth_text(depth: float, verdict: Verdict) -> str:
    """A depth in mm; how deep was looked where there is none."""
    if math.isinf(depth):
        return f"> {_mm_text(_searched_depth(verdict))}"
    return _mm_text(depth)


def _searched_depth(verdict: Verdict) -> float:
    """Depth (m) up to which every draw was looked at."""
    if math.isinf(verdict.limit) or verdict.samples is None:
        return MAX_PROGRAM_DEPTH_RATIO * verdict.program.depth_mm / 1e3
    force = verdict.samples.rows.tangential
    return float(np.min(force[0] / force)) * float(TRIED_LIMIT_SHARES[-1]) * verdict.limit


def _mm_text(depth: float) -> str:
    mm = depth * 1e3
    return f"{mm:.2f}" if mm < 99.995 else f"{mm:.1f}" if mm < 999.95 else f"{mm:.0f}"


def programs_json(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The verdict on every program."""
    return [verdict_json(verdict) for verdict in verdicts]


def program_texts(logbook: Logbook) -> list[str | Table]:
    """The verdict on every program, where to ask on, and what is to be said of the files."""
    verdicts = logbook.verdicts()
    if not verdicts:
        return [*remark_lines(logbook.remarks)]
    texts: list[str | Table] = [verdict_table(verdicts), *verdict_notes(verdicts, logbook.machine)]
    if not all(map(is_safe, verdicts)):
        texts.append("lobewatch check says what would settle it, and where to go instead")
    return [*texts, *remark_lines(logbook.remarks)]
