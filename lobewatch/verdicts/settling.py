"""Which part of the doubt keeps a program from being called stable, and what would settle it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Remark
from lobes import MillingRows
from lobewatch.machine import ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.drawn import DRAWS, Drawn

LOOKED_AT = 60
"""Draws that chatter, of which it is seen what each lacks to be stable."""


def decisive(drawn: Drawn, chatters: NDArray[np.bool_], middle: MillingRows, depth: float) -> str:
    """The cause without which most of the draws that chatter (DRAWS,) at a depth (m) would not.

    Where none of them chatters a direction that was not tapped is all that is left open.
    """
    if "untapped" in drawn.doubt.modes or not np.any(chatters):
        return "untapped"
    which = np.flatnonzero(chatters)[:LOOKED_AT]
    mended = {}
    for cause in drawn.doubt.causes:
        rows = drawn.doubt.draw(middle, DRAWS, without=cause)[which]
        mended[cause] = float(np.mean(replace(drawn, rows=rows).growth(depth) < 0))
    return max(mended, key=lambda cause: mended[cause])


def settles(cause: str, table: ProgramTable, tangential: float, assembly: Assembly, cuts: int) -> Remark:
    """What would settle it; tangential: Kt (Pa) above which the program chatters in the middle of all else.

    cuts: number of test cuts that have taught of it.
    """
    known = "".join(assembly.directions)
    text, cure = {
        "coefficients": (
            f"the cutting coefficients decide: chatters above Kt {tangential / 1e6:.0f} N/mm2",
            "measure them, or name the material",
        ),
        "speed": ("the spindle speed decides", "run it in the middle of a window of speeds"),
        "clamping": (
            "the scatter from tap test to tap test decides",
            "tap again: from 8 tests on the scatter of this very tool counts",
        ),
        "tap": ("the error of the tap test decides", "tap again with more hits"),
        "prediction": ("the prediction decides", f"tap tool {table.tool!r}"),
        "cuts": (
            f"the spindle at speed decides, as {cuts} test cuts have left it open",
            f"make the next test cut: lobewatch suggest names it for {table.name!r}",
        ),
        "question": (
            f"it rests on a tap test in question ({', '.join(dict.fromkeys(one.code for one in assembly.questions))})",
            "answer the question, or tap again",
        ),
        "untapped": (f"direction {'y' if known == 'x' else 'x'} was not tapped", f"tap {'y' if known == 'x' else 'x'}"),
    }[cause]
    return Remark("doubt-decides", table.name, text, cure)
