"""A model fitted to the modes of several tap tests, which are looked for in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from dsm import (
    Spindle,
    StiffnessFit,
    StiffnessFitError,
    UnreachableFrequencyError,
    calibrate,
    fit_stiffness,
    modes_at,
)
from lobewatch.logbook.joints.groupings import Grouping, grouping_for, start_factors
from lobewatch.logbook.joints.matching import Match, match
from lobewatch.logbook.joints.tapped_tools import TappedTool

MODES = 8
"""Modes of the model that are compared."""
GRID = np.geomspace(0.1, 10.0, 9)
"""Factors on either stiffness of the joints that are tried."""
TRIED = 2
"""Most numberings of the modes that are fitted to."""
ROUNDS = 2
"""Most times that modes are looked for anew in the model that was fitted to them."""


class Start(NamedTuple):
    """Factors to begin with, and the modes that are found with them."""

    cost: float
    """Distance of all modes from the model."""
    bearings: float
    """Factor on the bearings."""
    radial: float
    """Factor on the radial stiffness of joints."""
    tilting: float
    """Factor on their stiffness against tilting."""
    matches: tuple[Match, ...]
    """One a tap test."""


@dataclass(frozen=True, eq=False)
class KnownModes:
    """Modes of tap tests by their number in the model, and the model fitted to them."""

    taps: Sequence[TappedTool]
    """The tap tests."""
    matches: tuple[Match, ...]
    """One a tap test."""
    grouping: Grouping
    """Grouping of the parts that share a factor."""
    fit: StiffnessFit
    """The model."""


def known_modes(taps: Sequence[TappedTool], position: float) -> KnownModes:
    """The modes followed, and of those around them what the model has nearby, in its order and about as stiff.

    position: where all were tapped, from the tool tip (m). For joints from a tenth to ten times as stiff as given, the
    mode followed of the first tool sets the bearings, and the other modes are numbered where they fit best. Then the
    model is fitted to all of them, and they are looked for in it anew. Raises what dsm.fit_stiffness raises.
    """
    starts = _distinct(sorted(_starts(taps, position), key=lambda start: start.cost))
    if not starts:
        return _fitted(taps, Start(0.0, 1.0, 1.0, 1.0, tuple(Match(0.0, ((t.number, t.followed),)) for t in taps)))
    best = None
    for start in starts[:TRIED]:
        with suppress(StiffnessFitError, UnreachableFrequencyError):
            settled = _settled(taps, start, position)
            best = settled if best is None or (best.fit.misfits and not settled.fit.misfits) else best
        if best is not None and not best.fit.misfits:
            break
    return best or _fitted(taps, starts[0])


def _starts(taps: Sequence[TappedTool], position: float) -> Iterator[Start]:
    first = taps[0]
    for radial, tilting in product(GRID.tolist(), GRID.tolist()):
        with suppress(ValueError, ArithmeticError):
            stiffer = [_with_joints(tap.spindle, radial, tilting) for tap in taps]
            factor = calibrate(stiffer[0], first.followed.frequency, mode=first.number).factor
            matches = _matches(taps, [_with_bearings(spindle, factor) for spindle in stiffer], position)
            yield Start(sum(match.cost for match in matches), factor, radial, tilting, matches)


def _distinct(starts: Sequence[Start]) -> list[Start]:
    """The best of each numbering."""
    return list({str(_numbers(start.matches)): start for start in reversed(starts)}.values())[::-1]


def _with_joints(spindle: Spindle, radial: float, tilting: float) -> Spindle:
    joints = [
        replace(joint, stiffness=radial * joint.stiffness, rotational_stiffness=tilting * joint.rotational_stiffness)
        if joint.group
        else joint
        for joint in spindle.joints
    ]
    return replace(spindle, joints=joints)


def _with_bearings(spindle: Spindle, factor: float) -> Spindle:
    bearings = [
        replace(bearing, stiffness=factor * bearing.stiffness) if bearing.group else bearing
        for bearing in spindle.bearings
    ]
    return replace(spindle, bearings=bearings)


def _settled(taps: Sequence[TappedTool], start: Start, position: float) -> KnownModes:
    """Fitted and looked for anew, until the same modes are found."""
    fitted = _fitted(taps, start)
    for _ in range(ROUNDS):
        matches = _matches(taps, fitted.fit.spindles, position)
        if _numbers(matches) == _numbers(fitted.matches):
            break
        fitted = _fitted(taps, start._replace(matches=matches))
    return fitted


def _matches(taps: Sequence[TappedTool], spindles: Sequence[Spindle], position: float) -> tuple[Match, ...]:
    matches = []
    for tap, spindle in zip(taps, spindles, strict=True):
        frequency, stiffness = modes_at(spindle, max(MODES, tap.number), position)
        matches.append(match(tap, frequency.tolist(), stiffness.tolist()))
    return tuple(matches)


def _numbers(matches: Sequence[Match]) -> list[list[tuple[int, float]]]:
    return [[(number, mode.frequency) for number, mode in match.modes] for match in matches]


def _fitted(taps: Sequence[TappedTool], start: Start) -> KnownModes:
    numbered = [(tap, number, mode) for tap, match in enumerate(start.matches) for number, mode in match.modes]
    grouping = grouping_for(taps[0].spindle, len(numbered))
    spindles = [grouping(tap.spindle) for tap in taps]
    fit = fit_stiffness(
        spindles,
        [mode.frequency for _, _, mode in numbered],
        [taps[tap].std(mode) for tap, _, mode in numbered],
        [number for _, number, _ in numbered],
        shaft=[tap for tap, _, _ in numbered],
        start=start_factors(spindles[0], start.bearings, start.radial, start.tilting),
        tolerance=taps[0].tolerance,
    )
    return KnownModes(taps, start.matches, grouping, fit)
