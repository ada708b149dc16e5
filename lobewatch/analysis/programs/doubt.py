"""What is not known of a program on a spindle, as numbers: made here from tap tests and machine.toml, drawn from here.

Half-widths of independent uniform distributions. Whatever is said of a program over its doubt comes from these draws.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes import MillingRows, cutting_coefficients
from lobewatch.analysis.assembly import Assembly
from lobewatch.analysis.series import Scatter
from lobewatch.machine import CutTable, DoubtTable, Machine
from modal import Mode

SCATTER = Scatter(0.003, 0.10, 0.03)
"""From tap test to tap test, until a series tells its own."""
LEAST = 0.02
"""Nothing is drawn below this share of its middle value."""

Floats = NDArray[np.float64]


class Span(NamedTuple):
    """Lowest and highest value over the middle one."""

    low: float
    """At most 1."""
    high: float
    """At least 1."""


@dataclass(frozen=True, eq=False)
class Doubt:
    """What is not known, by what it comes from."""

    modes: Mapping[str, Floats]
    """Relative half-widths of frequency, damping ratio and stiffness of the modes in x, then y, shape (n, 3), by cause:
    "tap" (the error of the tap test), "clamping" (from tap test to tap test), "prediction" (a tool that was never
    tapped), "untapped" (a direction that was not)."""
    speed: float
    """Relative half-width of the spindle speed."""
    tangential: Span
    """Of the cutting coefficient Kt."""
    ratio: Span
    """Of Kr/Kt, the direction of the force."""

    @property
    def causes(self) -> tuple[str, ...]:
        """All that it comes from."""
        return (*self.modes, "speed", "coefficients")

    def draw(self, middle: MillingRows, count: int, seed: int = 0, without: str = "") -> MillingRows:
        """Systems within the doubt (count rows) around one (a row), the same for a seed whatever is left out.

        without: a cause that is taken as known.
        """
        random = np.random.default_rng(seed)
        factor = np.ones((count, middle.frequency.shape[1], 3))
        for cause, widths in self.modes.items():
            moved = 1 + widths * random.uniform(-1, 1, factor.shape)
            factor *= 1.0 if cause == without else np.maximum(moved, LEAST)
        speed = 1 + self.speed * random.uniform(-1, 1, count) * (without != "speed")
        tangential, ratio = (span.low + (span.high - span.low) * random.uniform(0, 1, count) for span in self._spans)
        if without == "coefficients":
            tangential, ratio = np.ones((2, count))
        all_of_them = middle[np.zeros(count, dtype=np.intp)]
        return replace(
            all_of_them,
            frequency=all_of_them.frequency * factor[..., 0],
            damping_ratio=all_of_them.damping_ratio * factor[..., 1],
            stiffness=all_of_them.stiffness * factor[..., 2],
            speed_rpm=all_of_them.speed_rpm * np.maximum(speed, LEAST),
            tangential=all_of_them.tangential * np.maximum(tangential, LEAST),
            radial=all_of_them.radial * np.maximum(tangential, LEAST) * np.maximum(ratio, 0.0),
        )

    @property
    def _spans(self) -> tuple[Span, Span]:
        return self.tangential, self.ratio


def doubt_of(assembly: Assembly, table: CutTable, machine: Machine) -> Doubt:
    """The doubt of a cut with a tool in the spindle as it is known at some time."""
    tangential, ratio = _coefficients(table, machine)
    return Doubt(_modes(assembly, machine.doubt), machine.doubt.speed_percent / 100, tangential, ratio)


def _modes(assembly: Assembly, given: DoubtTable) -> dict[str, Floats]:
    x, y = assembly.x or (), assembly.y or ()
    number, absent = len(x) + len(y), np.zeros((len(x) + len(y), 3))
    if assembly.predicted:
        predicted = (
            given.predicted_frequency_percent,
            given.predicted_damping_percent,
            given.predicted_stiffness_percent,
        )
        made = {"prediction": np.tile(np.array(predicted) / 100, (number, 1))}
    else:
        sides = (("x", len(x)), ("y", len(y)))
        clamping = [np.tile(_scatter(assembly, side, given), (count, 1)) for side, count in sides]
        made = {"tap": np.array([_error(mode) for mode in (*x, *y)]), "clamping": np.vstack(clamping)}
    if len(assembly.directions) == 1:
        unknown = slice(len(x), None) if assembly.directions[0] == "x" else slice(0, len(x))
        made["untapped"] = absent
        absent[unknown] = given.untapped_frequency_percent / 100, 0.0, given.untapped_stiffness_percent / 100
    return made


def _scatter(assembly: Assembly, side: str, given: DoubtTable) -> Scatter:
    """What machine.toml says, else the series itself, else the default."""
    known = side if side in assembly.directions else assembly.directions[0]
    found = assembly.scatter(known) or SCATTER
    asked = (given.frequency_percent, given.damping_percent, given.stiffness_percent)
    return Scatter(*(own if wish is None else wish / 100 for own, wish in zip(found, asked, strict=True)))


def _error(mode: Mode) -> Floats:
    """95 % of the error of the tap test, relative; 0 where it is not known."""
    values = np.array([mode.frequency, mode.damping_ratio, mode.stiffness])
    return np.asarray(np.nan_to_num(mode.quantile() * mode.standard_error / values))


def _coefficients(table: CutTable, machine: Machine) -> tuple[Span, Span]:
    """Kt and Kr/Kt over the middle: the published range of an alloy with several tests, else that of [doubt]."""
    own = machine.coefficients(table)
    alike = [one for one in cutting_coefficients() if own.alloy and one.alloy == own.alloy]
    if len(alike) < 2 or own.radial == 0:
        share = machine.doubt.coefficients_percent / 100
        return Span(1 - share, 1 + share), Span(1 - share, 1 + share)
    tangential = [one.tangential / own.tangential for one in alike]
    ratio = [one.radial / one.tangential * own.tangential / own.radial for one in alike]
    return Span(min(tangential), max(tangential)), Span(min(ratio), max(ratio))
