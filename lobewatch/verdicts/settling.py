"""Which part of the doubt keeps a program from being called stable, and what would settle it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition import Remark
from lobewatch.machine import ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.draws import DRAWS
from lobewatch.verdicts.judgement import Judgement

MENDED = 60
"""Number of draws that chatter, of which it is seen what each lacks to be stable."""


def decisive_cause(judgement: Judgement, depth: float) -> str:
    """The cause without which most of the draws that chatter at a depth (m) would not.

    Where none of them chatters a direction that was not tapped is all that is left open.
    """
    draws, doubt = judgement.draws, judgement.draws.doubt
    if "untapped" in doubt.modes or not np.any(judgement.chatters):
        return "untapped"
    places, middle = np.flatnonzero(judgement.chatters)[:MENDED], draws.rows[np.array([0])]
    shares = {}
    for cause in doubt.causes:
        rows = doubt.draw(middle, DRAWS, without=cause)[places]
        shares[cause] = float(np.mean(replace(draws, rows=rows).growth(depth) < 0))
    return max(shares, key=lambda cause: shares[cause])


def settling_remark(cause: str, table: ProgramTable, tangential: float, assembly: Assembly, cuts: int) -> Remark:
    """What would settle it; tangential: Kt (Pa) above which the program chatters in the middle of all else.

    cuts: number of test cuts that have taught of it.
    """
    text, cure = {
        "coefficients": (
            f"the cutting coefficients decide: chatters above Kt {tangential / 1e6:.0f} N/mm2",
            "measure them" if table.material else "measure them, or name the material",
        ),
        "speed": ("the spindle speed decides", "run it in the middle of a window of speeds"),
        "clamping": (
            "the scatter from tap test to tap test decides",
            "tap again: from 8 tests on the scatter of this very tool counts",
        ),
        "tap": ("the error of the tap test decides", "tap again with more hits"),
        "prediction": ("the prediction decides", f"tap tool {table.tool!r}"),
        "wear": (
            f"wear decides: chatters above Kt {tangential / 1e6:.0f} N/mm2",
            'run it with new edges and write wear = "new"',
        ),
        "workpiece": (
            "the wall that is cut is thin: it gives way, and its modes are not known",
            "support it and take thin = true out, or find the depth by test cuts",
        ),
        "cuts": (
            f"the spindle at speed decides, as {cuts} test cuts have left it open",
            f"make the next test cut: lobewatch suggest names it for {table.name!r}",
        ),
        "cross": ("the axes of the modes decide, which taps in x and in y leave open", "tap --direction xy"),
        "question": (
            f"it rests on a tap test in question ({', '.join(dict.fromkeys(q.code for q in assembly.questions))})",
            "answer the question, or tap again",
        ),
        "untapped": assembly.gap,
    }[cause]
    return Remark("doubt-decides", table.name, text, cure)
