"""What a spindle opposes to a tool, without the tool."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.matrix.assemble import assemble
from dsm.matrix.condense_damped import condense_damped
from dsm.matrix.frequency_axis import frequency_axis
from dsm.spindle.attachments import Joint
from dsm.spindle.cut_spindle import cut_spindle
from dsm.spindle.spindle import Spindle, Theory, require_support

_Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class SpindleSide:
    """Dynamic stiffness of a spindle where its tool was cut off, for deflection and slope there; see couple_tool."""

    frequency: NDArray[np.float64]
    """Frequencies (Hz), shape (n,)."""
    force_over_deflection: _Complex
    """Force over deflection (N/m), shape (n,)."""
    force_over_slope: _Complex
    """Force over slope (N), shape (n,); the same as moment over deflection."""
    moment_over_slope: _Complex
    """Moment over slope (N m), shape (n,)."""
    loss_factor: float
    """Loss factor of all stiffness (-); the tool gets the same."""
    theory: Theory
    """Beam theory, which that of the tool must be."""


def spindle_side(spindle: Spindle, frequency: ArrayLike, position: float, loss_factor: float = 0.0) -> SpindleSide:
    """All of a spindle beyond `position` from its tool tip (m), by dynamic condensation to the place of the cut.

    frequency: (n,) Hz. loss_factor: as for receptance. A bearing, a mass or a joint where the spindle is cut counts as
    part of it; all that is nearer to the tip falls away. Raises ValueError as receptance does, for a cut off the shaft,
    and where a rigid bearing holds the shaft at the cut.

    >>> whole = Spindle([Segment(0.1, 0.02), Segment(0.3, 0.05)], [Bearing(0.15, 2e8), Bearing(0.38, 2e8)])
    >>> side = spindle_side(whole, np.array([100.0, 500.0]), position=0.1)  # where the tool is cut off
    >>> (side.force_over_deflection.real / 1e6).round(1).tolist()  # N/um
    [176.5, 160.3]
    """
    f = frequency_axis(frequency)
    rest, joint = cut_spindle(spindle, position)
    if np.any(f == 0):
        require_support(rest)
    model = assemble(rest, float(np.max(f, initial=0.0)))
    if np.any(model.held[0]):
        raise ValueError(f"position={position} m is held by a rigid bearing; cut the shaft elsewhere")
    k = condense_damped(model, rest, f, loss_factor, node=0)
    stiffness = (k.uu, k.ut, k.tt)
    if joint is not None:
        stiffness = _through(joint, loss_factor, *stiffness)
    return SpindleSide(f, *stiffness, loss_factor, spindle.theory)


def _through(
    joint: Joint, loss_factor: float, uu: _Complex, ut: _Complex, tt: _Complex
) -> tuple[_Complex, _Complex, _Complex]:
    """The stiffness K with the joint in series: J (K + J)^-1 K with J = diag(k, tilt)."""
    k, tilt = (1 + 1j * loss_factor) * np.array([joint.stiffness, joint.rotational_stiffness])
    both = uu * tt - ut * ut
    determinant = (uu + k) * (tt + tilt) - ut * ut
    return k * (uu * tilt + both) / determinant, k * tilt * ut / determinant, tilt * (k * tt + both) / determinant
