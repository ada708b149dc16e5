"""Calibrate joints and bearings of the model from tap tests of several tools."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import timedelta
from itertools import product
from typing import Any, NamedTuple

import numpy as np

import dsm
from acquisition import DataError, Remark
from lobewatch.logbook import tool_modes
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine

NUM_COMPARED_MODEL_MODES = 8
"""Number of model modes that measured modes are compared with."""
JOINT_STIFFNESS_FACTORS = np.geomspace(0.1, 10.0, 9).tolist()
"""Initial factors on radial and tilting stiffness of the joints."""
MAX_FITTED_NUMBERINGS = 2
"""Number of mode numberings that are fitted at most."""
MAX_REMATCH_ROUNDS = 2
"""Number of times that modes are matched again to the fitted model at most."""
Grouping = Callable[[dsm.Spindle], dsm.Spindle]
"""Function that assigns the springs of a spindle to groups with a common factor."""


def choose_grouping(spindle: dsm.Spindle, modes: int) -> Grouping:
    """Choose the finest grouping that needs no more factors than there are modes."""
    finer = (split_tilting_groups, keep_groups)
    return next((grouping for grouping in finer if len(_group_names(grouping(spindle))) <= modes), merge_groups)


def compute_start_factors(spindle: dsm.Spindle, bearings: float, radial: float, tilting: float) -> list[float]:
    """List one factor for each group, bearings first. A common group of a joint gets the geometric mean."""
    springs = [(bearing.group, bearings) for bearing in spindle.bearings]
    for joint in spindle.joints:
        separate = [(joint.group, radial), (joint.rotational_group, tilting)]
        springs += separate if joint.rotational_group else [(joint.group, math.sqrt(radial * tilting))]
    return list({name: factor for name, factor in springs if name}.values())


def split_tilting_groups(spindle: dsm.Spindle) -> dsm.Spindle:
    """Give the tilting stiffness of each joint a group of its own."""
    joints = [
        replace(joint, rotational_group=joint.rotational_group or f"{joint.group} tilting") if joint.group else joint
        for joint in spindle.joints
    ]
    return replace(spindle, joints=joints)


def keep_groups(spindle: dsm.Spindle) -> dsm.Spindle:
    """Keep the groups of machine.toml."""
    return spindle


def merge_groups(spindle: dsm.Spindle) -> dsm.Spindle:
    """Put all calibrated bearings into one group and all joints into another."""
    bearings = [replace(bearing, group="bearings" if bearing.group else "") for bearing in spindle.bearings]
    joints = [replace(joint, group="joint" if joint.group else "", rotational_group="") for joint in spindle.joints]
    return replace(spindle, bearings=bearings, joints=joints)


def _group_names(spindle: dsm.Spindle) -> set[str]:
    joints = {name for joint in spindle.joints for name in (joint.group, joint.rotational_group)}
    return ({bearing.group for bearing in spindle.bearings} | joints) - {""}


class InitialGuess(NamedTuple):
    """Initial factors of a fit, with the modes matched to the scaled model."""

    cost: float
    """Distance of all modes from the model (-)."""
    bearings: float
    """Factor on the bearing stiffness (-)."""
    radial: float
    """Factor on the radial stiffness of the joints (-)."""
    tilting: float
    """Factor on the tilting stiffness of the joints (-)."""
    matches: tuple[tool_modes.ToolModeMatch, ...]
    """Matched modes of each tap test."""


class JointFit(NamedTuple):
    """Spindle model fitted to the matched modes of several tap tests."""

    taps: Sequence[tool_modes.TappedTool]
    """Tools with their tap tests."""
    matches: tuple[tool_modes.ToolModeMatch, ...]
    """Matched modes of each tap test."""
    grouping: Grouping
    """Grouping of the springs that share a factor."""
    fit: dsm.StiffnessFit
    """Fitted stiffness."""


def fit_joints(taps: Sequence[tool_modes.TappedTool], position: float) -> JointFit:
    """Fit bearings and joints to the matched modes of several tap tests.

    For joints from a tenth to ten times as stiff as given, the followed mode of the first tool sets the bearings, and
    the other modes get the numbers that fit best. Then the model is fitted to all modes, and the modes are matched
    again. `position` is the tapped point, from the tool tip (m). Raises the errors of `dsm.fit_stiffness`.
    """
    starts = _select_distinct(sorted(_generate_guesses(taps, position), key=lambda start: start.cost))
    if not starts:
        followed = tuple(tool_modes.ToolModeMatch(0.0, ((tap.mode_number, tap.followed),)) for tap in taps)
        return _fit_model(taps, InitialGuess(0.0, 1.0, 1.0, 1.0, followed))
    best = None
    for start in starts[:MAX_FITTED_NUMBERINGS]:
        with suppress(dsm.StiffnessFitError, dsm.UnreachableFrequencyError):
            fitted = _iterate_fit(taps, start, position)
            best = fitted if best is None or (best.fit.has_misfit and not fitted.fit.has_misfit) else best
        if best is not None and not best.fit.has_misfit:
            break
    return best or _fit_model(taps, starts[0])


def _generate_guesses(taps: Sequence[tool_modes.TappedTool], position: float) -> Iterator[InitialGuess]:
    first = taps[0]
    for radial, tilting in product(JOINT_STIFFNESS_FACTORS, repeat=2):
        with suppress(ValueError, ArithmeticError):
            factors = {"stiffness": radial, "rotational_stiffness": tilting}
            scaled = [replace(tap.spindle, joints=_scale_springs(tap.spindle.joints, factors)) for tap in taps]
            factor = dsm.calibrate(scaled[0], first.followed.frequency, mode=first.mode_number).factor
            bearings = [_scale_springs(spindle.bearings, {"stiffness": factor}) for spindle in scaled]
            spindles = [replace(spindle, bearings=new) for spindle, new in zip(scaled, bearings, strict=True)]
            matches = _match_all(taps, spindles, position)
            yield InitialGuess(sum(match.cost for match in matches), factor, radial, tilting, matches)


def _select_distinct(starts: Sequence[InitialGuess]) -> list[InitialGuess]:
    """Keep the best guess of each numbering."""
    return list({str(_mode_numbers(start.matches)): start for start in reversed(starts)}.values())[::-1]


def _scale_springs(springs: Sequence[Any], factors: Mapping[str, float]) -> list[Any]:
    """Scale stiffnesses of the bearings or joints that belong to a group."""
    scaled = [{name: factor * getattr(spring, name) for name, factor in factors.items()} for spring in springs]
    return [replace(spring, **new) if spring.group else spring for spring, new in zip(springs, scaled, strict=True)]


def _iterate_fit(taps: Sequence[tool_modes.TappedTool], start: InitialGuess, position: float) -> JointFit:
    """Fit and match again until the matched modes stay the same."""
    fitted = _fit_model(taps, start)
    for _ in range(MAX_REMATCH_ROUNDS):
        matches = _match_all(taps, fitted.fit.spindles, position)
        if _mode_numbers(matches) == _mode_numbers(fitted.matches):
            break
        fitted = _fit_model(taps, start._replace(matches=matches))
    return fitted


def _match_all(
    taps: Sequence[tool_modes.TappedTool], spindles: Sequence[dsm.Spindle], position: float
) -> tuple[tool_modes.ToolModeMatch, ...]:
    matches = []
    for tap, spindle in zip(taps, spindles, strict=True):
        frequency, stiffness = dsm.modes_at(spindle, max(NUM_COMPARED_MODEL_MODES, tap.mode_number), position)
        matches.append(tool_modes.assign_mode_numbers(tap, frequency.tolist(), stiffness.tolist()))
    return tuple(matches)


def _mode_numbers(matches: Sequence[tool_modes.ToolModeMatch]) -> list[list[tuple[int, float]]]:
    return [[(number, mode.frequency) for number, mode in match.modes] for match in matches]


def _fit_model(taps: Sequence[tool_modes.TappedTool], start: InitialGuess) -> JointFit:
    numbered = [(tap, number, mode) for tap, match in enumerate(start.matches) for number, mode in match.modes]
    grouping = choose_grouping(taps[0].spindle, len(numbered))
    spindles = [grouping(tap.spindle) for tap in taps]
    fit = dsm.fit_stiffness(
        spindles,
        [mode.frequency for _, _, mode in numbered],
        [taps[tap].frequency_std(mode) for tap, _, mode in numbered],
        [number for _, number, _ in numbered],
        shaft=[tap for tap, _, _ in numbered],
        start=compute_start_factors(spindles[0], start.bearings, start.radial, start.tilting),
        tolerance=taps[0].tolerance,
    )
    return JointFit(taps, start.matches, grouping, fit)


class JointCalibration(NamedTuple):
    """Joint and bearing stiffness fitted to several tools."""

    label: str
    """Label of the model in machine.toml."""
    taps: tuple[tool_modes.TappedTool, ...]
    """Fitted tools, one for each spindle of the fit."""
    fit: dsm.StiffnessFit
    """Fitted stiffness of bearings and joints."""
    predicted: dict[str, dsm.PredictedMode]
    """Softest tip mode of each tool that was not fitted, by name. Empty if stiffnesses share a factor."""
    joints: tuple[dsm.Joint, ...]
    """Joints to write into machine.toml. Empty if that is no improvement."""
    unmatched: dict[str, tuple[float, ...]]
    """Frequencies (Hz) of measured modes without a model mode nearby, by tool."""
    remarks: tuple[Remark, ...]
    """Remarks on shared factors and on the time between the tap tests."""


def calibrate_joints(
    logbook: Logbook, tools: Sequence[str], direction: str | None = None, mode: Sequence[int] = ()
) -> JointCalibration:
    """Fit bearings and joints to the newest tap tests of several tools in one direction.

    The followed modes give one factor for all bearings and one for all joints. Further modes of the same tests refine
    this: each group gets its own factor, and joints one for each stiffness, as far as there are modes. `direction` and
    `mode` are those of `find_tapped_tools`. DataError for a model without a group of joints, and if nothing fits.
    """
    machine = logbook.machine
    if not any(joint.group for joint in machine.model(tools[0]).joints):
        cure = 'Add a group in machine.toml, such as group = "holder" for the joint between tool and spindle.'
        raise DataError(f"no joint of [spindle] has a group. {cure}")
    taps = tool_modes.find_tapped_tools(logbook, tools, direction, mode)
    try:
        joint_fit = fit_joints(taps, machine.tap.position_mm / 1e3)
    except (dsm.StiffnessFitError, dsm.UnreachableFrequencyError) as error:
        raise DataError(f"tools {' and '.join(map(repr, tools))} do not fit one spindle: {error}") from error
    fit, grouping = joint_fit.fit, joint_fit.grouping
    label = machine.spindle.label if machine.spindle else ""
    is_split = grouping is split_tilting_groups
    predicted = dict(_predict_other_tools(machine, fit, grouping, tools)) if is_split else {}
    joints = _joints_for_toml(fit, grouping, machine.model(machine.tap.tool))
    remarks = *_shared_factor_remarks(joint_fit), *_time_gap_remarks(taps, machine)
    return JointCalibration(label, tuple(taps), fit, predicted, joints, dict(_find_unmatched(joint_fit)), remarks)


def _predict_other_tools(
    machine: Machine, fit: dsm.StiffnessFit, grouping: Grouping, tools: Sequence[str]
) -> Iterator[tuple[str, dsm.PredictedMode]]:
    for name in [machine.tap.tool, *(tool.name for tool in machine.modelled_tools)]:
        if name in tools:
            continue
        spindle = grouping(machine.model(name))
        with suppress(ArithmeticError):
            softest = int(np.argmin(dsm.modes_at(fit.apply_to(spindle), NUM_COMPARED_MODEL_MODES)[1]))
            yield name, dsm.predict_mode(fit, spindle, softest + 1)


def _joints_for_toml(fit: dsm.StiffnessFit, grouping: Grouping, drawn: dsm.Spindle) -> tuple[dsm.Joint, ...]:
    """Return all joints as fitted. Empty if the tools do not fit one spindle or no joint has an effect."""
    joints = fit.apply_to(grouping(drawn)).joints
    names = {name for joint in joints for name in (joint.group, joint.rotational_group) if name}
    if fit.has_misfit or names & {*fit.groups} <= fit.open_groups:
        return ()
    return tuple(replace(joint, group=old.group) for joint, old in zip(joints, drawn.joints, strict=True))


def _find_unmatched(joint_fit: JointFit) -> Iterator[tuple[str, tuple[float, ...]]]:
    for tap, match in zip(joint_fit.taps, joint_fit.matches, strict=True):
        matched = {id(mode) for _, mode in match.modes}
        unmatched = tuple(mode.frequency for mode in tool_modes.select_neighbor_modes(tap) if id(mode) not in matched)
        if unmatched:
            yield tap.tool, unmatched


def _shared_factor_remarks(joint_fit: JointFit) -> Iterator[Remark]:
    if joint_fit.grouping is not split_tilting_groups:
        shared = "all bearings share one stiffness factor, " if joint_fit.grouping is merge_groups else ""
        kept = f"{shared}the ratios of the joint stiffnesses are kept and other tools are not predicted"
        text = f"only {joint_fit.fit.mode.size} measured modes, so {kept}"
        cure = "Measure more modes with a wider [mode] band_hz or a harder hammer tip"
        yield Remark("factors-shared", "", text, cure)


def _time_gap_remarks(taps: Sequence[tool_modes.TappedTool], machine: Machine) -> Iterator[Remark]:
    times = [tap.time for tap in taps]
    days = (max(times) - min(times)) / timedelta(days=1)
    if days > machine.machine.interval_days:
        text = f"tools tapped {days:.0f} days apart, so the bearings may have changed"
        yield Remark("taps-apart", ", ".join(tap.tool for tap in taps), text, "Tap all of these tools on one day")
