"""Receptance and static stiffness of a spindle, and tools coupled to it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Complexes, Floats
from dsm.matrix.assemble import assemble
from dsm.matrix.condense import condense_damped
from dsm.matrix.dynamic_stiffness import check_frequencies
from dsm.spindle.attachments import Joint
from dsm.spindle.spindle import Spindle, Theory, check_tool, cut_spindle, require_support


def receptance(
    spindle: Spindle,
    frequency: ArrayLike,
    position: float = 0.0,
    loss_factor: float = 0.0,
    force_position: float | None = None,
) -> Complexes:
    """Driving-point or transfer receptance, deflection over force (m/N), shape (n,), of the shaft at rest: all modes.

    frequency: (n,) Hz. position: where the deflection is, distance from the tool tip (m). loss_factor eta: all
    stiffness k becomes k (1 + i eta), so that every mode has the damping ratio eta/2; the dampers of the bearings come
    on top. force_position: where the force is (m); None: at the same place, the driving point.

    Raises ValueError for frequencies that are negative or not finite, a loss factor below 0, a position off the
    shaft, and 0 Hz for a shaft that is not held.

    At resonance it is 1 / (eta K), for eta = 2 zeta; the other modes are hardly seen there:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> peak = receptance(shaft, natural_frequencies(shaft, 1), position=0.25, loss_factor=0.04)
    >>> round(float(abs(peak[0])) * 1e6, 3)  # um/N
    0.996
    >>> round(1 / (0.04 * modal_stiffness(shaft, 1, 0.25)) * 1e6, 3)
    0.996
    """
    f = check_frequencies(frequency)
    if np.any(f == 0):
        require_support(spindle)
    places = sorted([position, position if force_position is None else force_position])
    model = assemble(spindle, float(np.max(f, initial=0.0)), places)
    nodes = [model.node(place) for place in places]
    if np.any(model.held[nodes, 0]):
        return np.zeros(f.size, dtype=np.complex128)
    k = condense_damped(model, spindle, f, loss_factor, node=nodes[1], start=nodes[0])
    return np.asarray((k.share_u * k.tt - k.share_t * k.ut) / (k.uu * k.tt - k.ut * k.ut))


def linearized_stiffness(coefficients: ArrayLike, wbar: float) -> tuple[Floats, Floats]:
    """K_stat and M of the straight line K_stat - w^2 M that touches K(w) at w = wbar, over w^2.

    coefficients: those of K in powers of w^2, on the last axis, e.g. (n, n, n_terms); wbar: angular frequency
    (rad/s), >= 0. Both results have the shape of one coefficient, e.g. (n, n), and its units: N/m and kg where dofs
    are deflections.

    M = -dK/d(w^2) and K_stat = K + wbar^2 M, both at wbar: eqs. (32)-(34) of Gaber & Hashemi, Shock and Vibration,
    2015, the linearisation from which their eqs. (30)-(36) take the static stiffness at the tip. With
    K = sum c_n w^2n it is K_stat = sum (1 - n) c_n wbar^2n: the true static stiffness c_0 but for -c_2 wbar^4 and
    smaller terms, and c_0 itself at wbar = 0, where the paper's form of K has no value. So static_stiffness needs no
    linearisation; this one is there to show what it costs.

    Raises ValueError for coefficients that are not finite or have no last axis, and for a wbar that is negative or
    not finite.

    >>> k, m = linearized_stiffness([3e7, -2.0, -1e-9], 0.0)  # c_0 in N/m, c_1 in kg, c_2 in kg s^2
    >>> float(k), float(m)  # N/m, kg: at rest c_0 and -c_1
    (30000000.0, 2.0)
    >>> k, m = linearized_stiffness([3e7, -2.0, -1e-9], 4000.0)  # rad/s
    >>> round(float(k)), round(float(m), 3)  # c_0 - c_2 wbar^4 and -c_1 - 2 c_2 wbar^2
    (30256000, 2.032)
    """
    c = np.asarray(coefficients, dtype=np.float64)
    if c.ndim == 0 or c.shape[-1] == 0:
        raise ValueError(f"coefficients of shape {c.shape} have no last axis of powers of w^2")
    if not np.all(np.isfinite(c)):
        raise ValueError("coefficients hold a value that is not finite; look at the model they come from")
    if not (math.isfinite(wbar) and wbar >= 0):
        raise ValueError(f"wbar={wbar} is not a finite angular frequency >= 0 (rad/s)")
    order = np.arange(c.shape[-1])
    power = (wbar * wbar) ** order
    return c @ ((1 - order) * power), -(c[..., 1:] @ (order[1:] * power[:-1]))


def static_stiffness(spindle: Spindle, position: float = 0.0, linearized_at: float = 0.0) -> float:
    """Steady radial force over deflection at `position` from the tool tip (m), in N/m.

    Term 0 of the dynamic stiffness, exact: at rest every element is a link, and nothing is lost however soft the
    bearings are. linearized_at: a frequency (Hz) at which K(w) is replaced by K_stat - w^2 M
    instead, as eqs. (30)-(36) of Gaber & Hashemi, Shock and Vibration, 2015, do; what they miss grows with its fourth
    power. Raises ValueError for a position off the shaft, a shaft that is not held, and a frequency below 0.

    In the middle between two knife edges it is 48 E I / L^3:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> round(static_stiffness(shaft, position=0.25) / 1e6, 2)  # N/um
    24.74
    >>> round(48 * 210e9 * np.pi * 0.05**4 / 64 / 0.5**3 / 1e6, 2)
    24.74
    """
    require_support(spindle)
    if not (math.isfinite(linearized_at) and linearized_at >= 0):
        raise ValueError(f"linearized_at={linearized_at} Hz is not a finite number >= 0")
    model = assemble(spindle, linearized_at, [position])
    node = model.node(position)
    if model.held[node, 0]:
        return math.inf
    if linearized_at == 0:
        k = condense_damped(model, spindle, np.zeros(1), 0.0, node)
        return float((k.uu - k.ut**2 / k.tt)[0].real)
    terms = np.stack([model.term(power) for power in range(model.diagonal.shape[2])], axis=-1)
    stiffness, _ = linearized_stiffness(terms, 2 * np.pi * linearized_at)
    force = np.zeros(model.held.size)
    force[2 * node] = 1.0
    return float(1 / np.linalg.solve(stiffness, force)[2 * node])


@dataclass(frozen=True, eq=False)
class SpindleSide:
    """Dynamic stiffness of a spindle where its tool was cut off, for deflection and slope there; see couple_tool."""

    frequency: Floats
    """Frequencies (Hz), shape (n,)."""
    force_over_deflection: Complexes
    """Force over deflection (N/m), shape (n,)."""
    force_over_slope: Complexes
    """Force over slope (N), shape (n,); the same as moment over deflection."""
    moment_over_slope: Complexes
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
    f = check_frequencies(frequency)
    rest, joint = cut_spindle(spindle, position)
    if np.any(f == 0):
        require_support(rest)
    model = assemble(rest, float(np.max(f, initial=0.0)))
    if np.any(model.held[0]):
        raise ValueError(f"position={position} m is held by a rigid bearing; cut the shaft elsewhere")
    k = condense_damped(model, rest, f, loss_factor, node=0)
    stiffness = (k.uu, k.ut, k.tt)
    if joint is not None:
        stiffness = _add_joint(joint, loss_factor, *stiffness)
    return SpindleSide(f, *stiffness, loss_factor, spindle.theory)


def _add_joint(
    joint: Joint, loss_factor: float, uu: Complexes, ut: Complexes, tt: Complexes
) -> tuple[Complexes, Complexes, Complexes]:
    """The stiffness K with the joint in series: J (K + J)^-1 K with J = diag(k, tilt)."""
    k, tilt = (1 + 1j * loss_factor) * np.array([joint.stiffness, joint.rotational_stiffness])
    both = uu * tt - ut * ut
    determinant = (uu + k) * (tt + tilt) - ut * ut
    return k * (uu * tilt + both) / determinant, k * tilt * ut / determinant, tilt * (k * tt + both) / determinant


def couple_tool(side: SpindleSide, tool: Spindle) -> Complexes:
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
