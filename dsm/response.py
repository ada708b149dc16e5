"""Receptance and static stiffness of a spindle, and tools coupled to it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Complexes, Floats, require_number
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
    """Compute the driving-point or transfer receptance of the shaft without rotation, with all modes.

    Parameters
    ----------
    spindle : Spindle
        Spindle with dampers.
    frequency : array_like, shape (n,)
        Frequencies (Hz).
    position : float
        Position of the deflection, from the tool tip (m).
    loss_factor : float
        Loss factor eta (-): all stiffness k becomes k (1 + i eta), so that every mode has the damping ratio eta/2;
        the bearing dampers are added.
    force_position : float, optional
        Position of the force (m). Default: the same place, the driving point.

    Returns
    -------
    ndarray of complex, shape (n,)
        Deflection over force (m/N).

    Raises
    ------
    ValueError
        For frequencies that are negative or not finite, a loss factor below 0, a position off the
        shaft, and 0 Hz for an unsupported shaft.

    Examples
    --------
    At resonance it is 1 / (eta K), for eta = 2 zeta; the other modes hardly matter there:

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
    """Return K_stat and M of the tangent K_stat - w^2 M to K(w) at w = wbar, over w^2.

    M = -dK/d(w^2) and K_stat = K + wbar^2 M, both at wbar: eqs. (32)-(34) of Gaber & Hashemi, the linearization from
    which their eqs. (30)-(36) take the static stiffness at the tip. With
    K = sum c_n w^2n it is K_stat = sum (1 - n) c_n wbar^2n: the true static stiffness c_0 but for -c_2 wbar^4 and
    smaller terms, and c_0 itself at wbar = 0, where the paper's form of K has no value. So static_stiffness needs no
    linearization; this function shows its error.

    Parameters
    ----------
    coefficients : array_like, shape (..., n_terms)
        Coefficients of K in powers of w^2, on the last axis.
    wbar : float
        Angular frequency (rad/s), >= 0.

    Returns
    -------
    tuple of ndarray
        K_stat and M in the shape and units of one coefficient: N/m and kg if dofs are deflections.

    Raises
    ------
    ValueError
        For coefficients that are not finite or have no last axis, and for a wbar that is negative or not finite.

    References
    ----------
    Gaber & Hashemi, Shock and Vibration, 2015.

    Examples
    --------
    >>> k, m = linearized_stiffness([3e7, -2.0, -1e-9], 0.0)  # c_0 in N/m, c_1 in kg, c_2 in kg s^2
    >>> float(k), float(m)  # N/m, kg: without rotation c_0 and -c_1
    (30000000.0, 2.0)
    >>> k, m = linearized_stiffness([3e7, -2.0, -1e-9], 4000.0)  # rad/s
    >>> round(float(k)), round(float(m), 3)  # c_0 - c_2 wbar^4 and -c_1 - 2 c_2 wbar^2
    (30256000, 2.032)
    """
    c = np.asarray(coefficients, dtype=np.float64)
    if c.ndim == 0 or c.shape[-1] == 0:
        raise ValueError(f"coefficients have shape {c.shape}. Give the powers of w^2 along the last axis.")
    if not np.all(np.isfinite(c)):
        raise ValueError("coefficients have values that are not finite. Check the model.")
    if not (math.isfinite(wbar) and wbar >= 0):
        raise ValueError(f"wbar={wbar} is not a finite angular frequency >= 0 (rad/s)")
    order = np.arange(c.shape[-1])
    power = (wbar * wbar) ** order
    return c @ ((1 - order) * power), -(c[..., 1:] @ (order[1:] * power[:-1]))


def static_stiffness(spindle: Spindle, position: float = 0.0, linearized_at: float = 0.0) -> float:
    """Compute the static radial stiffness of a spindle at one place.

    Term 0 of the dynamic stiffness, exact: every element is a link, and nothing is lost even for soft bearings.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    position : float
        Distance from the tool tip (m).
    linearized_at : float
        Frequency (Hz) at which K(w) is replaced by K_stat - w^2 M, as eqs. (30)-(36) of Gaber & Hashemi, Shock and
        Vibration, 2015, do; their error grows with its fourth power.

    Returns
    -------
    float
        Force over deflection (N/m).

    Raises
    ------
    ValueError
        For a position off the shaft, an unsupported shaft, and a frequency below 0.

    Examples
    --------
    In the middle between two knife edges it is 48 E I / L^3:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> round(static_stiffness(shaft, position=0.25) / 1e6, 2)  # N/um
    24.74
    >>> round(48 * 210e9 * np.pi * 0.05**4 / 64 / 0.5**3 / 1e6, 2)
    24.74
    """
    require_support(spindle)
    require_number("linearized_at", linearized_at, " Hz")
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
    """Dynamic stiffness of a spindle at the tool interface, for deflection and slope there."""

    frequency: Floats
    """Frequencies (Hz), shape (n,)."""
    force_over_deflection: Complexes
    """Force over deflection (N/m), shape (n,)."""
    force_over_slope: Complexes
    """Force over slope (N), shape (n,); equal to moment over deflection."""
    moment_over_slope: Complexes
    """Moment over slope (N m), shape (n,)."""
    loss_factor: float
    """Loss factor of all stiffness (-), used for the tool, too."""
    theory: Theory
    """Beam theory, also of the tool."""


def spindle_side(spindle: Spindle, frequency: ArrayLike, position: float, loss_factor: float = 0.0) -> SpindleSide:
    """Condense a spindle without its tool to the tool interface.

    A bearing, a mass or a joint at the cut is part of the spindle; everything nearer to the tip is removed.

    Parameters
    ----------
    spindle : Spindle
        Spindle with any tool.
    frequency : array_like, shape (n,)
        Frequencies (Hz).
    position : float
        Distance of the cut from the tool tip (m).
    loss_factor : float
        Loss factor (-), as for receptance.

    Returns
    -------
    SpindleSide
        Stiffness at the interface.

    Raises
    ------
    ValueError
        As receptance, for a cut off the shaft, and for a rigid bearing at the cut.

    Examples
    --------
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
        raise ValueError(f"position={position} m is at a rigid bearing. Cut the shaft elsewhere.")
    k = condense_damped(model, rest, f, loss_factor, node=0)
    stiffness = (k.uu, k.ut, k.tt)
    if joint is not None:
        stiffness = _add_joint(joint, loss_factor, *stiffness)
    return SpindleSide(f, *stiffness, loss_factor, spindle.theory)


def _add_joint(
    joint: Joint, loss_factor: float, uu: Complexes, ut: Complexes, tt: Complexes
) -> tuple[Complexes, Complexes, Complexes]:
    """Return the stiffness K with the joint in series: J (K + J)^-1 K with J = diag(k, tilt)."""
    k, tilt = (1 + 1j * loss_factor) * np.array([joint.stiffness, joint.rotational_stiffness])
    both = uu * tt - ut * ut
    determinant = (uu + k) * (tt + tilt) - ut * ut
    return k * (uu * tilt + both) / determinant, k * tilt * ut / determinant, tilt * (k * tt + both) / determinant


def couple_tool(side: SpindleSide, tool: Spindle) -> Complexes:
    """Compute the receptance at the tip of a tool in a spindle given by its interface stiffness.

    Equal to receptance of the whole shaft, change_tool.

    Parameters
    ----------
    side : SpindleSide
        Spindle without tool.
    tool : Spindle
        Tool as a free shaft: its first segment is the tip, its last one is fixed to the spindle.

    Returns
    -------
    ndarray of complex, shape (n,)
        Deflection over force at the tool tip (m/N), at the frequencies of `side`.

    Raises
    ------
    ValueError
        For a tool with bearings or of another beam theory.

    References
    ----------
    T. L. Schmitz and R. R. Donaldson, Predicting high-speed machining dynamics by substructure analysis, CIRP
    Annals 49 (2000), here in stiffnesses, so that nothing is lost at low frequencies.

    Examples
    --------
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
