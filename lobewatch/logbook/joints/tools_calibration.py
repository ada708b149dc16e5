"""Joints and bearings of a model from tap tests of several tools."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import timedelta

import numpy as np

from acquisition import DataError, Remark
from dsm import (
    Joint,
    PredictedMode,
    Spindle,
    StiffnessFit,
    StiffnessFitError,
    UnreachableFrequencyError,
    modes_at,
    predict_mode,
)
from lobewatch.logbook.joints.groupings import Grouping, divided, merged
from lobewatch.logbook.joints.known_modes import MODES, KnownModes, known_modes
from lobewatch.logbook.joints.matching import nearest
from lobewatch.logbook.joints.tapped_tools import TappedTool, tapped_tools
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine


@dataclass(frozen=True)
class ToolsCalibration:
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
    left_out: dict[str, tuple[float, ...]]
    """Frequencies (Hz) of other modes of the tap tests that the model has nowhere near, by tool."""
    remarks: tuple[Remark, ...]
    """Remarks on what makes the fit doubtful, beside its own."""


def calibrate_tools(
    logbook: Logbook, tools: Sequence[str], direction: str | None = None, mode: Sequence[int] = ()
) -> ToolsCalibration:
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
    taps = tapped_tools(logbook, tools, direction, mode)
    try:
        fitted_modes = known_modes(taps, machine.tap.position_mm / 1e3)
    except (StiffnessFitError, UnreachableFrequencyError) as error:
        raise DataError(f"tools {' and '.join(map(repr, tools))} do not fit one spindle: {error}") from error
    fit, grouping = fitted_modes.fit, fitted_modes.grouping
    return ToolsCalibration(
        machine.spindle.label if machine.spindle else "",
        tuple(taps),
        fit,
        dict(_predictions(machine, fit, grouping, tools)) if grouping is divided else {},
        _to_enter(fit, grouping, machine.model(machine.tap.tool)),
        dict(_left_out(fitted_modes)),
        (*_shared(fitted_modes), *_apart(taps, machine)),
    )


def _predictions(
    machine: Machine, fit: StiffnessFit, grouping: Grouping, tools: Sequence[str]
) -> Iterator[tuple[str, PredictedMode]]:
    for name in [machine.tap.tool, *(tool.name for tool in machine.modelled_tools)]:
        if name in tools:
            continue
        spindle = grouping(machine.model(name))
        with suppress(ArithmeticError):
            softest = int(np.argmin(modes_at(fit.applied_to(spindle), MODES)[1]))
            yield name, predict_mode(fit, spindle, softest + 1)


def _to_enter(fit: StiffnessFit, grouping: Grouping, drawn: Spindle) -> tuple[Joint, ...]:
    """All joints of machine.toml as found; none where the tools do not fit one spindle, or no joint is felt."""
    joints = fit.applied_to(grouping(drawn)).joints
    names = {name for joint in joints for name in (joint.group, joint.rotational_group) if name}
    if fit.misfits or names & {*fit.groups} <= fit.open_groups:
        return ()
    return tuple(replace(joint, group=old.group) for joint, old in zip(joints, drawn.joints, strict=True))


def _left_out(fitted_modes: KnownModes) -> Iterator[tuple[str, tuple[float, ...]]]:
    for tap, match in zip(fitted_modes.taps, fitted_modes.matches, strict=True):
        counted = [mode for _, mode in match.modes]
        left = [mode.frequency for mode in nearest(tap) if not any(mode is counted_mode for counted_mode in counted)]
        if left:
            yield tap.tool, tuple(left)


def _shared(fitted_modes: KnownModes) -> Iterator[Remark]:
    """Fewer factors than stiffnesses."""
    if fitted_modes.grouping is not divided:
        shared = "all bearings share a factor, and " if fitted_modes.grouping is merged else ""
        count = fitted_modes.fit.mode.size
        text = f"{count} modes are too few: {shared}all stiffnesses of the joint keep their given ratio; "
        cure = "measure more modes: a wider [mode] band_hz, a harder hammer tip"
        yield Remark("factors-shared", "", f"{text}other tools are not predicted", cure)


def _apart(taps: Sequence[TappedTool], machine: Machine) -> Iterator[Remark]:
    """Bearings may have changed from one test to the other."""
    times = [tap.time for tap in taps]
    days = (max(times) - min(times)) / timedelta(days=1)
    if days > machine.machine.tap_interval_days:
        text = f"{days:.0f} days lie between them, in which the bearings may have changed"
        yield Remark("taps-apart", ", ".join(tap.tool for tap in taps), text, "tap all of them on one day")
