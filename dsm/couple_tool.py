"""Tip receptance of any tool in a spindle that is known by its stiffness where the tool begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.assemble import assemble
from dsm.change_tool import check_tool
from dsm.checks import require_positive
from dsm.condense import condense
from dsm.damped_blocks import damped_blocks
from dsm.spindle import Spindle
from dsm.spindle_side import SpindleSide

_Complex = NDArray[np.complex128]


def couple_tool(side: SpindleSide, tool: Spindle, joint: tuple[float, float] | None = None) -> _Complex:
    """Deflection over force at the tool tip (m/N), at the frequencies of the spindle side, shape (n,).

    tool: a free shaft, its first segment the tip, its last one fast to the spindle. joint: radial stiffness (N/m) and
    stiffness against tilting (N m/rad) between tool and spindle; None: rigid. Equal to the receptance of the whole
    shaft, change_tool, but for the steps that stand for a cone, which depend on the length of the shaft it is part of.
    Source: T. L. Schmitz and R. R. Donaldson, Predicting high-speed machining dynamics by substructure analysis, CIRP
    Annals 49 (2000), here in stiffnesses, so that nothing is lost at low frequencies.

    Raises ValueError for a tool with bearings or of another beam theory, and joint stiffnesses that are not > 0.
    """
    check_tool(tool, side.theory)
    model = assemble(tool, float(np.max(side.frequency, initial=0.0)))
    w = np.asarray(2 * np.pi * side.frequency, dtype=np.complex128)
    diagonal, coupling = damped_blocks(model, tool, w, side.loss_factor)
    diagonal[:, -1] += _through_joint(side, joint)
    k = condense(diagonal, coupling, node=0)
    return np.asarray(k.tt / (k.uu * k.tt - k.ut * k.ut))


def _through_joint(side: SpindleSide, joint: tuple[float, float] | None) -> _Complex:
    """Stiffness of the spindle side as felt through the joint, shape (3, n): the joint in series with it."""
    uu, ut, tt = side.force_over_deflection, side.force_over_slope, side.moment_over_slope
    if joint is None:
        return np.stack([uu, ut, tt])
    require_positive("joint: ", "stiffness", joint[0], "N/m")
    require_positive("joint: ", "rotational_stiffness", joint[1], "N m/rad")
    k, tilt = (1 + 1j * side.loss_factor) * np.array(joint)
    # J (K + J)^-1 K with J = diag(k, tilt)
    both = uu * tt - ut * ut
    determinant = (uu + k) * (tt + tilt) - ut * ut
    return np.asarray(np.array([k * (uu * tilt + both), k * tilt * ut, tilt * (k * tt + both)]) / determinant)
