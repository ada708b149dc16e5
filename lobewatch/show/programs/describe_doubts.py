"""The doubt that programs were judged over: its sizes, where each comes from, and what test cuts have taught of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobewatch.machine import DoubtTable, Machine
from lobewatch.tool import Assembly
from lobewatch.tool.series import ENOUGH
from lobewatch.verdicts import Verdict
from lobewatch.verdicts.doubt import Doubt, Span
from lobewatch.verdicts.spindle_at_speed import SpindleAtSpeed

PAGE = "docs/lobes.md"
"""Page that says where the sizes come from."""
AT_REST = (
    "The words hold for the spindle as tapped, at rest, and low..high for 98 % of the doubt. turning: chance of "
    "chatter once it turns and cuts, where frequency, damping, stiffness and cutting force may differ; plausible, not "
    "measured."
)
"""Sentences that a table of verdicts is read by."""
GIVEN = "machine.toml"
SIZES = "frequency", "damping_ratio", "stiffness", "phase_deg"
DEGREE = 180 / np.pi
NOTHING = 5e-5
"""A smaller half-width is not told."""
NAMES = {
    "tangential": "Kt",
    "ratio": "Kr/Kt",
    "frequency_x": "frequency in x",
    "frequency_y": "frequency in y",
    "damping_x": "damping in x",
    "damping_y": "damping in y",
    "stiffness_x": "stiffness in x",
    "stiffness_y": "stiffness in y",
}
"""Terms of what test cuts teach, by the name of the factor; further modes of a direction: `term`."""

Floats = NDArray[np.float64]


def term(name: str) -> str:
    """Term of a factor: "frequency_x_2" is that of the second mode in x."""
    if name in NAMES:
        return NAMES[name]
    leading, place = name.rsplit("_", 1)
    return f"{NAMES[leading]}, mode {place}"


def doubt_json(verdict: Verdict) -> dict[str, Any] | None:
    """Relative half-widths by cause (degrees of phases), those of modes in x, then y; None where nothing was judged."""
    if verdict.draws is None:
        return None
    doubt = verdict.draws.doubt
    modes = {
        cause: dict(zip(SIZES, (widths * [1, 1, 1, DEGREE]).T.tolist(), strict=True))
        for cause, widths in doubt.modes.items()
    }
    ends = {"tangential": doubt.tangential, "radial_over_tangential": doubt.ratio}
    return modes | {
        "speed": doubt.speed,
        "coefficients": {name: [span.low - 1, span.high - 1] for name, span in ends.items()},
    }


def reading_lines(verdicts: Sequence[Verdict], machine: Machine) -> list[str]:
    """Lines below a table of verdicts: what the words mean, and the doubt; none where nothing was judged."""
    doubts = doubt_lines(verdicts, machine)
    judged = [verdict for verdict in verdicts if verdict.draws is not None and verdict.assembly is not None]
    taught = [verdict for verdict in judged if verdict.cuts]
    texts = ([AT_REST] if len(taught) < len(judged) else []) + ([at_speed_line(taught)] if taught else [])
    return [*doubts, *texts] if doubts else []


def at_speed_line(taught: Sequence[Verdict]) -> str:
    """What the words mean where test cuts have taught."""
    names, cuts = ", ".join(verdict.program.name for verdict in taught), _cuts(taught[0].at_speed)
    return f"{names}: the words hold for the spindle as it turns, from {cuts}, and low..high for 98 % of it"


def _cuts(at_speed: SpindleAtSpeed) -> str:
    return f"{at_speed.cuts} cut{'s' if at_speed.cuts > 1 else ''}"


def doubt_lines(verdicts: Sequence[Verdict], machine: Machine) -> list[str]:
    """Doubt of the programs, a line for all that have it alike."""
    named: dict[str, list[str]] = {}
    for verdict in verdicts:
        if verdict.draws is not None and verdict.assembly is not None:
            parts = _parts(verdict, verdict.draws.doubt, verdict.assembly, machine)
            named.setdefault("; ".join(parts), []).append(verdict.program.name)
    about = {text: f"doubt of {', '.join(names)}" if len(named) > 1 else "doubt" for text, names in named.items()}
    return [f"{about[text]}: {text} ({PAGE})" for text in named]


def _parts(verdict: Verdict, doubt: Doubt, assembly: Assembly, machine: Machine) -> Iterator[str]:
    given, standard = machine.doubt, DoubtTable()
    if verdict.cuts:
        yield from _learnt(verdict.at_speed, doubt.speed)
        return
    missing = "y" if "x" in assembly.directions else "x"
    lacking = "usable" if missing in assembly.unusable else "tapped"
    about = {"prediction": "by the prediction", "untapped": f"in {missing}, not {lacking}"}
    for cause, widths in doubt.modes.items():
        if cause == "clamping":
            yield from _clamping(widths, assembly, given)
        elif np.any(widths > NOTHING):
            yield f"{_sizes(np.max(widths, axis=0))} {about.get(cause, 'by the tap test')}"
    if doubt.axes is not None and doubt.axes.signs:
        yield "modes askew to either side (cross not tapped)"
    yield f"speed {_half(doubt.speed)}" + (f" ({GIVEN})" if given.speed_percent != standard.speed_percent else "")
    yield from _coefficients(verdict, doubt, machine)


def _learnt(at_speed: SpindleAtSpeed, speed: float) -> Iterator[str]:
    """Intervals before and after the cuts; speed: half-width of the spindle speed, relative."""
    cuts = _cuts(at_speed)
    for key in ("tangential", "ratio", *(name for name in at_speed.before if name.startswith("frequency"))):
        before, after = (f"{span.low:.2f}..{span.high:.2f}" for span in (at_speed.before[key], at_speed.after[key]))
        name = term(key)
        yield f"{name} x {after}, {before} before the {cuts}" if name == "Kt" else f"{name} x {after} ({before})"
    yield f"speed {_half(speed)}"


def _clamping(widths: Floats, assembly: Assembly, given: DoubtTable) -> Iterator[str]:
    """Scatter from tap test to tap test, once where both directions have it alike."""
    places = {"x": 0, "y": len(assembly.x or ())}
    texts = {}
    for side in assembly.directions:
        texts[side] = f"{_sizes(widths[places[side]])} from tap to tap ({_source(assembly, side, given)})"
    alike = len(set(texts.values())) == 1
    yield from list(texts.values())[:1] if alike else (f"in {side} {text}" for side, text in texts.items())


def _source(assembly: Assembly, side: str, given: DoubtTable) -> str:
    asked = (given.frequency_percent, given.damping_percent, given.stiffness_percent)
    scatter = f"scatter of {len(assembly.series.get(side, ()))} tests"
    source = scatter if assembly.scatter(side) is not None else f"default until {ENOUGH} tests"
    if all(wish is not None for wish in asked):
        return GIVEN
    return source if all(wish is None for wish in asked) else f"{source}, {GIVEN}"


def _coefficients(verdict: Verdict, doubt: Doubt, machine: Machine) -> Iterator[str]:
    known = machine.coefficients(verdict.program)
    is_given = machine.doubt.coefficients_percent != DoubtTable().coefficients_percent
    source = f" ({GIVEN})" if is_given else ""
    if known.tangential_range is not None:
        source = f" (published for {known.alloy or known.material})"
    if doubt.tangential == doubt.ratio:
        yield f"Kt and Kr/Kt {_span(doubt.tangential)}{source}"
    else:
        yield f"Kt {_span(doubt.tangential)}, Kr/Kt {_span(doubt.ratio)}{source}"


def _sizes(widths: Floats) -> str:
    """Half-widths of frequency, damping ratio, stiffness and phase; those that are next to nothing are left out."""
    named = zip(("frequency", "damping", "stiffness"), widths[:3].tolist(), strict=True)
    texts = [f"{name} {_half(width)}" for name, width in named if width > NOTHING]
    texts += [f"phase ±{DEGREE * widths[3]:.2g} deg"] if widths[3] > NOTHING else []
    return ", ".join(texts) or "nothing"


def _half(width: float) -> str:
    return f"±{_percent(width)} %"


def _span(span: Span) -> str:
    if np.isclose(1 - span.low, span.high - 1):
        return _half(span.high - 1)
    return f"{100 * (span.low - 1):+.0f}..{100 * (span.high - 1):+.0f} %"


def _percent(share: float) -> str:
    return f"{100 * share:.2g}" if share < 0.0995 else f"{100 * share:.0f}"
