"""The preload left in the bearings of a machine, from the course of their stiffness."""

from __future__ import annotations

from collections.abc import Sequence

from dsm import PreloadLeft, preload_left
from lobewatch.decay.fallen import change_since_start, known_rows
from lobewatch.history.history import Row
from lobewatch.machine import Machine


def preload_of(rows: Sequence[Row], machine: Machine) -> PreloadLeft | None:
    """That of the newest test of a series over that where the series started; see dsm.preload_left.

    rows: of one tool and direction. None where no two tests gave a bearing stiffness, or not the newest, or where one
    of the calibrated bearings has rollers.
    """
    change = change_since_start(rows, "bearing_stiffness")
    if machine.spindle is None or not change.is_known or len(known_rows(rows, "bearing_stiffness")) < 2:
        return None
    return preload_left([one for one in machine.spindle.build().bearings if one.group], 1 + change.value / 100)
