"""The doubt that programs were judged over: its sizes, and where each comes from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobewatch.machine import DoubtTable, Machine
from lobewatch.show.programs.names import NAMES
from lobewatch.tool import Assembly
from lobewatch.tool.series import ENOUGH
from lobewatch.verdicts import Verdict
from lobewatch.verdicts.doubt import Doubt, Span
from lobewatch.verdicts.spindle_at_speed import SpindleAtSpeed

PAGE = "docs/lobes.md"
"""Where the sizes come from."""
AT_REST = (
    "The words hold for the spindle as tapped, at rest, and low..high for 98 % of the doubt. turning: chance of "
    "chatter once it turns and cuts, where f_n, zeta, K and the cutting force may differ; plausible, not measured."
)
"""What must be known to read a table of verdicts."""
GIVEN = "machine.toml"
SIZES = "frequency", "damping_ratio", "stiffness", "phase_deg"
DEGREE = 180 / np.pi
NOTHING = 5e-5
"""A smaller half-width is not told."""

Floats = NDArray[np.float64]


def doubt_json(found: Verdict) -> dict[str, Any] | None:
    """Relative half-widths by cause (degrees of phases), those of modes in x, then y; None where nothing was judged."""
    if found.drawn is None:
        return None
    doubt = found.drawn.doubt
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
    """What stands below a table of verdicts: what the words mean, and the doubt; nothing where nothing was judged."""
    doubts = doubt_lines(verdicts, machine)
    judged = [found for found in verdicts if found.drawn is not None and found.assembly is not None]
    taught = [found for found in judged if found.cuts]
    said = ([AT_REST] if len(taught) < len(judged) else []) + ([at_speed_line(taught)] if taught else [])
    return [*doubts, *said] if doubts else []


def at_speed_line(taught: Sequence[Verdict]) -> str:
    """What the words mean where test cuts have taught."""
    names, cuts = ", ".join(found.program.name for found in taught), _cuts(taught[0].at_speed)
    return f"{names}: the words hold for the spindle as it turns, from {cuts}, and low..high for 98 % of it"


def _cuts(at_speed: SpindleAtSpeed) -> str:
    return f"{at_speed.cuts} cut{'s' if at_speed.cuts > 1 else ''}"


def doubt_lines(verdicts: Sequence[Verdict], machine: Machine) -> list[str]:
    """One for all programs that have it alike."""
    named: dict[str, list[str]] = {}
    for found in verdicts:
        if found.drawn is not None and found.assembly is not None:
            parts = _parts(found, found.drawn.doubt, found.assembly, machine)
            named.setdefault("; ".join(parts), []).append(found.program.name)
    about = {text: f"doubt of {', '.join(names)}" if len(named) > 1 else "doubt" for text, names in named.items()}
    return [f"{about[text]}: {text} ({PAGE})" for text in named]


def _parts(found: Verdict, doubt: Doubt, assembly: Assembly, machine: Machine) -> Iterator[str]:
    given, standard = machine.doubt, DoubtTable()
    known = "".join(assembly.directions)
    if found.cuts:
        yield from _learnt(found.at_speed, doubt.speed)
        return
    about = {"prediction": "by the prediction", "untapped": f"in {'y' if known == 'x' else 'x'}, not tapped"}
    for cause, widths in doubt.modes.items():
        if cause == "clamping":
            yield from _clamping(widths, assembly, given)
        elif np.any(widths > NOTHING):
            yield f"{_sizes(np.max(widths, axis=0))} {about.get(cause, 'by the tap test')}"
    yield f"speed {_half(doubt.speed)}" + (f" ({GIVEN})" if given.speed_percent != standard.speed_percent else "")
    yield from _coefficients(found, doubt, machine)


def _learnt(at_speed: SpindleAtSpeed, speed: float) -> Iterator[str]:
    """Intervals before and after the cuts; speed: half-width of the spindle speed, relative."""
    cuts = _cuts(at_speed)
    for name in ("Kt", "Kr/Kt", "f_n in x", "f_n in y"):
        key = next(key for key, told in NAMES.items() if told == name)
        before, after = (f"{span.low:.2f}..{span.high:.2f}" for span in (at_speed.before[key], at_speed.after[key]))
        yield f"{name} x {after}, {before} before the {cuts}" if name == "Kt" else f"{name} x {after} ({before})"
    yield f"speed {_half(speed)}"


def _clamping(widths: Floats, assembly: Assembly, given: DoubtTable) -> Iterator[str]:
    """From tap test to tap test, once where both directions have it alike."""
    places = {"x": 0, "y": len(assembly.x or ())}
    said = {}
    for side in assembly.directions:
        said[side] = f"{_sizes(widths[places[side]])} from tap to tap ({_source(assembly, side, given)})"
    alike = len(set(said.values())) == 1
    yield from list(said.values())[:1] if alike else (f"in {side} {text}" for side, text in said.items())


def _source(assembly: Assembly, side: str, given: DoubtTable) -> str:
    asked = (given.frequency_percent, given.damping_percent, given.stiffness_percent)
    own = f"scatter of {len(assembly.series.get(side, ()))} tests"
    found = own if assembly.scatter(side) is not None else f"default until {ENOUGH} tests"
    if all(wish is not None for wish in asked):
        return GIVEN
    return found if all(wish is None for wish in asked) else f"{found}, {GIVEN}"


def _coefficients(found: Verdict, doubt: Doubt, machine: Machine) -> Iterator[str]:
    standard = DoubtTable().coefficients_percent
    alloy = machine.coefficients(found.program).alloy
    share = machine.doubt.coefficients_percent / 100
    by_default = doubt.tangential == Span(1 - share, 1 + share)
    source = "" if machine.doubt.coefficients_percent == standard else f" ({GIVEN})"
    if doubt.tangential == doubt.ratio:
        yield f"Kt and Kr/Kt {_span(doubt.tangential)}{source}"
    else:
        source = source if by_default else f" (published for {alloy})"
        yield f"Kt {_span(doubt.tangential)}, Kr/Kt {_span(doubt.ratio)}{source}"


def _sizes(widths: Floats) -> str:
    """Half-widths of frequency, damping ratio, stiffness and phase; those that are next to nothing are left out."""
    named = zip(("f_n", "zeta", "K"), widths[:3].tolist(), strict=True)
    said = [f"{name} {_half(width)}" for name, width in named if width > NOTHING]
    said += [f"phase ±{DEGREE * widths[3]:.2g} deg"] if widths[3] > NOTHING else []
    return ", ".join(said) or "nothing"


def _half(width: float) -> str:
    return f"±{_percent(width)} %"


def _span(span: Span) -> str:
    if np.isclose(1 - span.low, span.high - 1):
        return _half(span.high - 1)
    return f"{100 * (span.low - 1):+.0f}..{100 * (span.high - 1):+.0f} %"


def _percent(share: float) -> str:
    return f"{100 * share:.2g}" if share < 0.0995 else f"{100 * share:.0f}"
