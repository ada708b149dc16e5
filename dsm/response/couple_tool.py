"""Tip receptance of any tool in a spindle that is known by its stiffness where the tool begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.assemble import assemble
from dsm.matrix.condense_damped import condense_damped
from dsm.response.spindle_side import SpindleSide
from dsm.spindle.change_tool import check_tool
from dsm.spindle.spindle import Spindle

_Complex = NDArray[np.complex128]


def couple_tool(side: SpindleSide, tool: Spindle) -> _Complex:
    """Deflection over force at the tool tip (m/N), at the frequencies of the spindle side, shape (n,).

    tool: a free shaft, its first segment the tip, its last one fast to the spindle. Equal to receptance of the whole
    shaft, change_tool.
    Source: T. L. Schmitz and R. R. Donaldson, Predicting high-speed machining dynamics by substructure analysis, CIRP
    Annals 49 (2000), here in stiffnesses, so that nothing is lost at low frequencies.

    Raises ValueError for a tool with bearings or of another beam theory.

    A tool on a spindle whose side was worked out once is the whole shaft:

    >>> whole = Spindle([Segment(0.1, 0.02), Segment(0.3, 0.05)], [Bearing(0.15, 2e8), Bearing(0.38, 2e8)])
    >>> frequency = np.array([100.0, 500.0, 1000.0])
    >>> side = spindle_side(whole, frequency, position=0.1)
    >>> tool = Spindle([Segment(0.06, 0.02)], [])
    >>> tip = couple_tool(side, tool)
    >>> np.allclose(tip, receptance(change_tool(whole, 0.1, tool), frequency), rtol=1e-9)
    True
    """
    check_tool(tool, side.theory)
    model = assemble(tool, float(np.max(side.frequency, initial=0.0)))
    spindle = np.array([side.force_over_deflection, side.force_over_slope, side.moment_over_slope])
    k = condense_damped(model, tool, side.frequency, side.loss_factor, node=0, extra=spindle)
    return np.asarray(k.tt / (k.uu * k.tt - k.ut * k.ut))
