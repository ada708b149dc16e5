"""Calibrate joints and bearings of the model from tap tests of several tools."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import timedelta
from itertools import product
from typing import NamedTuple

import numpy as np

from acquisition import DataError, Remark
from dsm import (
    Joint,
    PredictedMode,
    Spindle,
    StiffnessFit,
    StiffnessFitError,
    UnreachableFrequencyError,
    calibrate,
    fit_stiffness,
    modes_at,
    predict_mode,
)
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.tool_modes import (
    ModeMatch,
    TappedTool,
    assign_mode_numbers,
    find_tapped_tools,
    select_neighbor_modes,
)
from lobewatch.machine import Machine

Grouping = Callable[[Spindle], Spindle]
"""The same spindle with other groups."""


def choose_grouping(spindle: Spindle, modes: int) -> Grouping:
    """The finest one that needs no more factors than there are modes; two at least are needed."""
    return next(
        (grouping for grouping in (split_tilting_groups, keep_groups) if len(_group_names(grouping(spindle))) <= modes),
        merge_groups,
    )


def compute_start_factors(spindle: Spindle, bearings: float, radial: float, tilting: float) -> list[float]:
    """A factor for each group, bearings first, in order of appearance; both of a joint that has one: the middle."""
    springs = [(bearing.group, bearings) for bearing in spindle.bearings]
    for joint in spindle.joints:
        alone = [(joint.group, radial), (joint.rotational_group, tilting)]
        springs += alone if joint.rotational_group else [(joint.group, math.sqrt(radial * tilting))]
    return list({name: factor for name, factor in springs if name}.values())


def split_tilting_groups(spindle: Spindle) -> Spindle:
    """The same with a group of its own for the stiffness of each joint against tilting."""
    return replace(
        spindle,
        joints=[
            replace(joint, rotational_group=joint.rotational_group or f"{joint.group} tilting")
            if joint.group
            else joint
            for joint in spindle.joints
        ],
    )


def keep_groups(spindle: Spindle) -> Spindle:
    """The same: groups as machine.toml has them."""
    return spindle


def merge_groups(spindle: Spindle) -> Spindle:
    """The same with one group for all bearings that are calibrated and one for all joints."""
    return replace(
        spindle,
        bearings=[replace(bearing, group="bearings" if bearing.group else "") for bearing in spindle.bearings],
        joints=[replace(joint, group="joint" if joint.group else "", rotational_group="") for joint in spindle.joints],
    )


def _group_names(spindle: Spindle) -> set[str]:
    joints = {name for joint in spindle.joints for name in (joint.group, joint.rotational_group)}
    return ({bearing.group for bearing in spindle.bearings} | joints) - {""}


NUM_COMPARED_MODEL_MODES = 8
"""Modes of the model that are compared."""
JOINT_STIFFNESS_FACTORS = np.geomspace(0.1, 10.0, 9)
"""Factors on either stiffness of the joints that are tried."""
MAX_FITTED_NUMBERINGS = 2
"""Most numberings of the modes that are fitted to."""
MAX_REMATCH_ROUNDS = 2
"""Most times that modes are looked for anew in the model that was fitted to them."""


class InitialGuess(NamedTuple):
    """Factors to begin with, and the modes that are found with them."""

    cost: float
    """Distance of all modes from the model."""
    bearings: float
    """Factor on the bearings."""
    radial: float
    """Factor on the radial stiffness of joints."""
    tilting: float
    """Factor on their stiffness against tilting."""
    matches: tuple[ModeMatch, ...]
    """One a tap test."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Modes of tap tests by their number in the model, and the model fitted to them."""

    taps: Sequence[TappedTool]
    """The tap tests."""
    matches: tuple[ModeMatch, ...]
    """One a tap test."""
    grouping: Grouping
    """Grouping of the parts that share a factor."""
    fit: StiffnessFit
    """The model."""


def fit_joints(taps: Sequence[TappedTool], position: float) -> JointFit:
    """The modes followed, and of those around them what the model has nearby, in its order and about as stiff.

    position: where all were tapped, from the tool tip (m). For joints from a tenth to ten times as stiff as given, the
    mode followed of the first tool sets the bearings, and the other modes are numbered where they fit best. Then the
    model is fitted to all of them, and they are looked for in it anew. Raises what dsm.fit_stiffness raises.
    """
    starts = _select_distinct(sorted(_generate_guesses(taps, position), key=lambda start: start.cost))
    if not starts:
        return _fit_model(
            taps, InitialGuess(0.0, 1.0, 1.0, 1.0, tuple(ModeMatch(0.0, ((t.mode_number, t.followed),)) for t in taps))
        )
    best = None
    for start in starts[:MAX_FITTED_NUMBERINGS]:
        with suppress(StiffnessFitError, UnreachableFrequencyError):
            settled = _iterate_fit(taps, start, position)
            best = settled if best is None or (best.fit.has_misfit and not settled.fit.has_misfit) else best
        if best is not None and not best.fit.has_misfit:
            break
    return best or _fit_model(taps, starts[0])


def _generate_guesses(taps: Sequence[TappedTool], position: float) -> Iterator[InitialGuess]:
    first = taps[0]
    for radial, tilting in product(JOINT_STIFFNESS_FACTORS.tolist(), JOINT_STIFFNESS_FACTORS.tolist()):
        with suppress(ValueError, ArithmeticError):
            stiffer = [_scale_joints(tap.spindle, radial, tilting) for tap in taps]
            factor = calibrate(stiffer[0], first.followed.frequency, mode=first.mode_number).factor
            matches = _match_all(taps, [_scale_bearings(spindle, factor) for spindle in stiffer], position)
            yield InitialGuess(sum(match.cost for match in matches), factor, radial, tilting, matches)


def _select_distinct(starts: Sequence[InitialGuess]) -> list[InitialGuess]:
    """The best of each numbering."""
    return list({str(_mode_numbers(start.matches)): start for start in reversed(starts)}.values())[::-1]


def _scale_joints(spindle: Spindle, radial: float, tilting: float) -> Spindle:
    joints = [
        replace(joint, stiffness=radial * joint.stiffness, rotational_stiffness=tilting * joint.rotational_stiffness)
        if joint.group
        else joint
        for joint in spindle.joints
    ]
    return replace(spindle, joints=joints)


def _scale_bearings(spindle: Spindle, factor: float) -> Spindle:
    bearings = [
        replace(bearing, stiffness=factor * bearing.stiffness) if bearing.group else bearing
        for bearing in spindle.bearings
    ]
    return replace(spindle, bearings=bearings)


def _iterate_fit(taps: Sequence[TappedTool], start: InitialGuess, position: float) -> JointFit:
    """Fitted and looked for anew, until the same modes are found."""
    fitted = _fit_model(taps, start)
    for _ in range(MAX_REMATCH_ROUNDS):
        matches = _match_all(taps, fitted.fit.spindles, position)
        if _mode_numbers(matches) == _mode_numbers(fitted.matches):
            break
        fitted = _fit_model(taps, start._replace(matches=matches))
    return fitted


def _match_all(taps: Sequence[TappedTool], spindles: Sequence[Spindle], position: float) -> tuple[ModeMatch, ...]:
    matches = []
    for tap, spindle in zip(taps, spindles, strict=True):
        frequency, stiffness = modes_at(spindle, max(NUM_COMPARED_MODEL_MODES, tap.mode_number), position)
        matches.append(assign_mode_numbers(tap, frequency.tolist(), stiffness.tolist()))
    return tuple(matches)


def _mode_numbers(matches: Sequence[ModeMatch]) -> list[list[tuple[int, float]]]:
    return [[(number, mode.frequency) for number, mode in match.modes] for match in matches]


def _fit_model(taps: Sequence[TappedTool], start: InitialGuess) -> JointFit:
    numbered = [(tap, number, mode) for tap, match in enumerate(start.matches) for number, mode in match.modes]
    grouping = choose_grouping(taps[0].spindle, len(numbered))
    spindles = [grouping(tap.spindle) for tap in taps]
    fit = fit_stiffness(
        spindles,
        [mode.frequency for _, _, mode in numbered],
        [taps[tap].frequency_std(mode) for tap, _, mode in numbered],
        [number for _, number, _ in numbered],
        shaft=[tap for tap, _, _ in numbered],
        start=compute_start_factors(spindles[0], start.bearings, start.radial, start.tilting),
        tolerance=taps[0].tolerance,
    )
    return JointFit(taps, start.matches, grouping, fit)


@dataclass(frozen=True)
class JointCalibration:
    """One model for several tools."""

    label: str
    """Label of the model in machine.toml."""
    taps: tuple[TappedTool, ...]
    """Tools that it was fitted to, one a spindle of the fit."""
    fit: StiffnessFit
    """The stiffness of bearings and joints."""
    predicted: dict[str, PredictedMode]
    """The softest mode at the tip of each tool that was not fitted to, by its name; empty where factors are shared."""
    joints: tuple[Joint, ...]
    """Joints to write into machine.toml; empty where that would be no improvement."""
    unmatched: dict[str, tuple[float, ...]]
    """Frequencies (Hz) of other modes of the tap tests that the model has nowhere near, by tool."""
    remarks: tuple[Remark, ...]
    """Remarks on what makes the fit doubtful, beside its own."""


def calibrate_joints(
    logbook: Logbook, tools: Sequence[str], direction: str | None = None, mode: Sequence[int] = ()
) -> JointCalibration:
    """Fit bearings and joints to the newest tap tests of several tools, in one direction; see tapped_tools.

    The modes followed, whose number in the model is known, give one factor for all bearings and one for all joints.
    Further modes of the same tests count too (known_modes), and each group gets a factor of its own, joints one for
    either stiffness, as far as there are modes for that. DataError for a model without a joint to find, and for tools
    that nothing fits.
    """
    machine = logbook.machine
    if not any(joint.group for joint in machine.model(tools[0]).joints):
        raise DataError(
            "no joint of [spindle] has a group: nothing but bearings could be found; give the joint between tool and "
            'spindle one, such as group = "holder" in joints of machine.toml'
        )
    taps = find_tapped_tools(logbook, tools, direction, mode)
    try:
        fitted_modes = fit_joints(taps, machine.tap.position_mm / 1e3)
    except (StiffnessFitError, UnreachableFrequencyError) as error:
        raise DataError(f"tools {' and '.join(map(repr, tools))} do not fit one spindle: {error}") from error
    fit, grouping = fitted_modes.fit, fitted_modes.grouping
    return JointCalibration(
        machine.spindle.label if machine.spindle else "",
        tuple(taps),
        fit,
        dict(_predict_other_tools(machine, fit, grouping, tools)) if grouping is split_tilting_groups else {},
        _joints_for_toml(fit, grouping, machine.model(machine.tap.tool)),
        dict(_find_unmatched(fitted_modes)),
        (*_shared_factor_remarks(fitted_modes), *_time_gap_remarks(taps, machine)),
    )


def _predict_other_tools(
    machine: Machine, fit: StiffnessFit, grouping: Grouping, tools: Sequence[str]
) -> Iterator[tuple[str, PredictedMode]]:
    for name in [machine.tap.tool, *(tool.name for tool in machine.modelled_tools)]:
        if name in tools:
            continue
        spindle = grouping(machine.model(name))
        with suppress(ArithmeticError):
            softest = int(np.argmin(modes_at(fit.apply_to(spindle), NUM_COMPARED_MODEL_MODES)[1]))
            yield name, predict_mode(fit, spindle, softest + 1)


def _joints_for_toml(fit: StiffnessFit, grouping: Grouping, drawn: Spindle) -> tuple[Joint, ...]:
    """All joints of machine.toml as found; none where the tools do not fit one spindle, or no joint is felt."""
    joints = fit.apply_to(grouping(drawn)).joints
    names = {name for joint in joints for name in (joint.group, joint.rotational_group) if name}
    if fit.has_misfit or names & {*fit.groups} <= fit.open_groups:
        return ()
    return tuple(replace(joint, group=old.group) for joint, old in zip(joints, drawn.joints, strict=True))


def _find_unmatched(fitted_modes: JointFit) -> Iterator[tuple[str, tuple[float, ...]]]:
    for tap, match in zip(fitted_modes.taps, fitted_modes.matches, strict=True):
        counted = [mode for _, mode in match.modes]
        left = [
            mode.frequency
            for mode in select_neighbor_modes(tap)
            if not any(mode is counted_mode for counted_mode in counted)
        ]
        if left:
            yield tap.tool, tuple(left)


def _shared_factor_remarks(fitted_modes: JointFit) -> Iterator[Remark]:
    """Fewer factors than stiffnesses."""
    if fitted_modes.grouping is not split_tilting_groups:
        shared = "all bearings share a factor, and " if fitted_modes.grouping is merge_groups else ""
        count = fitted_modes.fit.mode.size
        text = f"{count} modes are too few: {shared}all stiffnesses of the joint keep their given ratio; "
        cure = "measure more modes: a wider [mode] band_hz, a harder hammer tip"
        yield Remark("factors-shared", "", f"{text}other tools are not predicted", cure)


def _time_gap_remarks(taps: Sequence[TappedTool], machine: Machine) -> Iterator[Remark]:
    """Bearings may have changed from one test to the other."""
    times = [tap.time for tap in taps]
    days = (max(times) - min(times)) / timedelta(days=1)
    if days > machine.machine.tap_interval_days:
        text = f"{days:.0f} days lie between them, in which the bearings may have changed"
        yield Remark("taps-apart", ", ".join(tap.tool for tap in taps), text, "tap all of them on one day")
