"""What the tap tests of several tools say of joints and bearings, and of tools that were not tapped."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from rich.table import Table

from dsm import Joint, plus_minus
from lobewatch.logbook.joints.tools_calibration import ToolsCalibration
from lobewatch.show.spindle.describe_model import stiffness_fit_json
from lobewatch.show.terminal.output import table

NOT_FIT = "the tools do not fit one spindle: nothing is to be written into machine.toml"
OPEN = "no measured mode feels the joints: nothing is to be written into machine.toml"


def tools_json(calibration: ToolsCalibration) -> dict[str, Any]:
    """The fit, what it rests on, and other tools as it has them."""
    return stiffness_fit_json(calibration.fit) | {
        "taps": {tap.tool: tap.tap_id for tap in calibration.taps},
        "tool": [calibration.taps[i].tool for i in calibration.fit.shaft],
        "fits_one_spindle": not calibration.fit.misfits,
        "not_counted_hz": calibration.left_out,
        "machine_toml": _joint_lines(calibration.joints),
        "predicted": {name: mode._asdict() for name, mode in calibration.predicted.items()},
        "remarks": [*map(asdict, calibration.fit.remarks), *map(asdict, calibration.remarks)],
    }


def tools_texts(calibration: ToolsCalibration) -> list[str | Table]:
    """The fit, what it rests on, and other tools, for people."""
    label = [f"model: {calibration.label}"] if calibration.label else []
    taps = [
        f"spindle {number}: tool {tap.tool}, {tap.tap_id}, mode {tap.number} is followed"
        for number, tap in enumerate(calibration.taps, 1)
    ]
    left = [
        f"not counted: {', '.join(f'{f:.1f}' for f in frequencies)} Hz of tool {tool}, nothing of the model is near"
        for tool, frequencies in calibration.left_out.items()
    ]
    warnings = [f"warning: {remark}" for remark in calibration.remarks]
    return [*label, *taps, str(calibration.fit), *left, *warnings, *_to_enter(calibration), *_predicted(calibration)]


def _to_enter(calibration: ToolsCalibration) -> list[str]:
    if calibration.joints:
        unsure = ", ".join(sorted(calibration.fit.open_groups))
        caution = f" (open: {unsure}; good only together with the others)" if unsure else ""
        return [f"for [spindle] of machine.toml{caution}:", *_joint_lines(calibration.joints)]
    return [NOT_FIT if calibration.fit.misfits else OPEN]


def _joint_lines(joints: tuple[Joint, ...]) -> list[str]:
    """Joints as they stand in machine.toml."""
    if not joints:
        return []
    lines = [
        f"    {{ position_mm = {joint.position * 1e3:.6g}, stiffness_n_per_um = {joint.stiffness / 1e6:.4g}, "
        f"rotational_stiffness_n_m_per_rad = {joint.rotational_stiffness:.4g}, group = {json.dumps(joint.group)} }},"
        for joint in joints
    ]
    return ["joints = [", *lines, "]"]


def _predicted(calibration: ToolsCalibration) -> list[Table]:
    if not calibration.predicted or calibration.fit.misfits:
        return []
    rows = table("~tool, not tapped here", "softest mode (Hz)", "K at the tip (N/um)")
    for name, mode in calibration.predicted.items():
        frequency = plus_minus(mode.frequency, mode.frequency_std)
        rows.add_row(name, frequency, plus_minus(mode.stiffness, mode.stiffness_std, 1e6))
    return [rows]
