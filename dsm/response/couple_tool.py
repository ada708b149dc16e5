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
    """
    check_tool(tool, side.theory)
    model = assemble(tool, float(np.max(side.frequency, initial=0.0)))
    spindle = np.array([side.force_over_deflection, side.force_over_slope, side.moment_over_slope])
    k = condense_damped(model, tool, side.frequency, side.loss_factor, node=0, extra=spindle)
    return np.asarray(k.tt / (k.uu * k.tt - k.ut * k.ut))
