"""Natural frequencies of a spinning beam, proved complete by counting."""

from typing import get_args

import numpy as np
from scipy.linalg import eig, eigh

from dsm.arrays import Floats
from dsm.elements.element_series import MAX_ELEMENT_X
from dsm.modes.eigensolvers import newton_step, quadratic_form
from dsm.spindle.segment import nearest_index
from dsm.spinning.beam import SpinningBeam, SpinningChain, SpinningDof, angular_speed

SPINNING_INTERVAL_WIDTH = 1e-10
"""Relative half-width, in w, of the interval that is proved to contain each mode."""
SPINNING_ROUNDING = 16 * np.finfo(np.float64).eps
"""Half-width from rounding, relative to |phi|^T |K| |phi| of a mode with |phi^T (dK/dw) phi| = 1."""
TRIAL_ELEMENT_X = (MAX_ELEMENT_X, 1.0, 0.5)
"""Longest x of an element (see SpinningChain), tried in turn; Hermite elements have an error of w x^4/1440."""
MAX_SPINNING_INTERVAL = 1e-3
"""Half-width, relative to w + W, beyond which a mode is not proved."""
SAME_BEAM_PLACE = 1e-6
"""Largest distance of equal places, over the length."""


def spinning_modes(beam: SpinningBeam, count: int, spin: float) -> tuple[Floats, int, int]:
    """Return the `count` lowest steady w (rad/s) in the rotating frame, and the numbers of growing modes.

    The growing modes are counted twice: proved, and all. If the two numbers are equal, no mode is missed. Let n(w) be
    the number of negative eigenvalues of K(w). A mode phi steps it by +1 if its energy, -phi^T (dK/dw) phi, is
    positive, and by -1 if it is negative, which needs w < W (`spin`, rad/s). n(0) = n_u + n_v, the numbers of planar
    natural frequencies of the two planes below W. Of these n(0) negative squares of the energy each mode of negative
    energy takes two and each growing mode one, and at least |n_u - n_v| modes grow (with u = U exp(st), v = V exp(st)
    the count goes from that of the one plane to that of the other as s rises from 0). So min(n_u, n_v) modes of
    negative energy, each proved by its step, are all there are, and nothing is missed between the steps. Below all
    critical speeds n(w) simply is the number of modes below w (Wittrick and Williams). With fewer modes of negative
    energy the others have met modes of positive energy, and the pairs grow (flutter). That they were not merely
    overlooked follows from the Hermite start values, not from a proof.

    Raises ArithmeticError at a critical speed and if the steps do not prove the modes.
    """
    modes = None
    for fineness in TRIAL_ELEMENT_X:
        try:
            chain, w, shape = _start_values(beam, count, spin, fineness)
            planes = _count_planar_below(chain, spin)
            w, sign, width = _refine_modes(chain, w, shape, spin)
        except np.linalg.LinAlgError:
            continue
        if _has_expected_counts(chain, w, sign, width, spin, sum(planes)):
            modes = w[:count], abs(planes[0] - planes[1]), sum(planes) - 2 * int(np.sum(sign < 0))
            if modes[1] == modes[2]:
                break
    if modes is None:
        raise ArithmeticError(
            f"the modes at speed_rpm={spin * 30 / np.pi:g} cannot be verified: two coincide, or rounding is too large. "
            "Try a slightly different speed, and check for springs or segment ends very close together."
        )
    return modes


def _start_values(beam: SpinningBeam, count: int, spin: float, fineness: float) -> tuple[SpinningChain, Floats, Floats]:
    """Return a matrix exact up to the last wanted mode, and the modes of its Hermite elements."""
    waves = sum(s.length * (s.mass_per_length / max(s.rigidity_xx, s.rigidity_yy)) ** 0.25 for s in beam.segments)
    top = (np.pi * (count / 2 + 1) / waves) ** 2
    for _ in range(8):
        chain = _assemble_chain(beam, spin + top, fineness)
        w, shape = _hermite_modes(chain, count, spin, top)
        if w.size >= count and w[-1] <= top:
            return chain, w, shape
        top = max(2 * top, 1.01 * np.max(w, initial=0.0))
    raise np.linalg.LinAlgError(f"no frequency range contains all {count} modes")


def _assemble_chain(beam: SpinningBeam, top: float, fineness: float) -> SpinningChain:
    """Place nodes at segment ends, springs and held dofs, with elements short enough for w + W up to `top` (rad/s)."""
    ends = np.cumsum([0.0] + [segment.length for segment in beam.segments])
    node = ends
    for place in [spring.position for spring in beam.springs] + [position for position, _ in beam.held]:
        if np.min(np.abs(node - place)) > SAME_BEAM_PLACE * ends[-1]:
            node = np.sort(np.append(node, place))
    of_segment = np.searchsorted(ends, (node[:-1] + node[1:]) / 2) - 1
    rigidity = np.array([[segment.rigidity_yy, segment.rigidity_xx] for segment in beam.segments])[of_segment]
    mass = np.array([segment.mass_per_length for segment in beam.segments])[of_segment]
    x = np.diff(node) * (mass / np.min(rigidity, axis=1) * top**2) ** 0.25
    parts = np.maximum(np.ceil(x / fineness), 1).astype(int)
    length = np.repeat(np.diff(node) / parts, parts)
    position, spring = np.append(0.0, np.cumsum(length)), np.zeros(4 * length.size + 4)
    for given in beam.springs:
        for dof, stiffness in beam.stiffness(given):
            spring[_dof_index(position, given.position, dof)] += stiffness
    held = [_dof_index(position, place, dof) for place, dof in beam.held]
    free = np.setdiff1d(np.arange(spring.size), held)
    return SpinningChain(length, np.repeat(rigidity, parts, axis=0), np.repeat(mass, parts), spring, free)


def _dof_index(position: Floats, place: float, dof: SpinningDof) -> int:
    return 4 * nearest_index(position, place) + get_args(SpinningDof).index(dof)


def _hermite_modes(chain: SpinningChain, count: int, spin: float, top: float) -> tuple[Floats, Floats]:
    """Return w and shapes of (S - (w^2 + W^2) M - 2 w W C) phi = 0: the lowest, and all with possibly negative energy.

    With y = (phi, w phi / T), T = `top`: [[2 W T C, T^2 M], [T^2 M, 0]] y = (T/w) [[S - W^2 M, 0], [0, T^2 M]] y.
    """
    stiffness, mass, coupling = chain.hermite()
    scale = 1 / np.sqrt(np.diagonal(stiffness))
    stiffness, mass, coupling = (matrix * np.outer(scale, scale) for matrix in (stiffness, mass, coupling))
    mass, nothing = top**2 * mass, np.zeros_like(mass)
    carried = stiffness - (spin / top) ** 2 * mass
    right = np.block([[carried, nothing], [nothing, mass]])
    left = np.block([[2 * spin * top * coupling, mass], [mass, nothing]])
    if np.linalg.eigvalsh(carried)[0] > 0:
        ratio, vectors = eigh(left, right, subset_by_index=[len(left) - count, len(left) - 1])
        return top / ratio[::-1], (vectors[: scale.size, ::-1] * scale[:, np.newaxis]).T
    ratio, vectors = eig(left, right)
    steady = np.flatnonzero((ratio.real > 0) & (np.abs(ratio.imag) <= 1e-6 * np.abs(ratio)))
    steady = steady[np.argsort(-ratio.real[steady])]
    w = top / ratio.real[steady]
    wanted = slice(max(count, int(np.sum(w <= 1.05 * spin))))
    return w[wanted], (vectors.real[: scale.size, steady[wanted]] * scale[:, np.newaxis]).T


def _count_planar_below(chain: SpinningChain, spin: float) -> tuple[int, int]:
    """Count the planar natural frequencies below W, in the planes of u and of v."""
    at = np.zeros(1)
    planes = [chain.in_plane(0), chain.in_plane(1)]
    below = [int(plane.count(at, spin * (1 - SPINNING_INTERVAL_WIDTH))[0]) for plane in planes]
    if below != [int(plane.count(at, spin * (1 + SPINNING_INTERVAL_WIDTH))[0]) for plane in planes]:
        raise ArithmeticError(
            f"speed_rpm={spin * 30 / np.pi:.12g} is a critical speed, with a frequency of zero. "
            "Choose a lower or higher speed."
        )
    return below[0], below[1]


def _refine_modes(chain: SpinningChain, w: Floats, shape: Floats, spin: float) -> tuple[Floats, Floats, Floats]:
    """Refine all modes at once by inverse iteration: w, sign of the energy, and half-width; sorted."""
    width = SPINNING_INTERVAL_WIDTH * w
    for _ in range(8):
        previous, trial = w, w + width
        stiffness, slope = chain.matrices(trial, spin)
        w, moved, energy = newton_step(trial, stiffness, slope, shape, np.linalg.solve)
        w, sign, shape = np.abs(w), np.sign(-energy), moved / np.sqrt(np.abs(energy))[:, np.newaxis]
        rounding = SPINNING_ROUNDING * quadratic_form(np.abs(stiffness), np.abs(shape))
        width = SPINNING_INTERVAL_WIDTH * w + rounding
        if np.all(np.abs(w - previous) <= 1e-12 * w + rounding):
            break
    order = np.argsort(w)
    return w[order], sign[order], width[order]


def _has_expected_counts(chain: SpinningChain, w: Floats, sign: Floats, width: Floats, spin: float, at_0: int) -> bool:
    """Return whether the count steps by the sign of each mode in its own interval and nowhere else."""
    close = np.abs(np.subtract.outer(w, w)) <= width + width[:, np.newaxis]
    if np.any(close & (np.multiply.outer(sign, sign) < 0)) or np.any(width > MAX_SPINNING_INTERVAL * (w + spin)):
        return False
    edge = np.concatenate([w - width, w + width])
    edge = edge[edge > 0]
    expected = at_0 + (np.less.outer(w, edge).T * sign).sum(axis=1)
    return bool(np.all(chain.count(edge, spin) == expected))


class UnstableSpinError(ArithmeticError):
    """Raised if modes grow at this speed: mostly between the critical speeds of the two planes.

    Parameters
    ----------
    message : str
        Text of the error.
    frequency : ndarray
        Lowest frequencies of the other modes, as many as requested (Hz).
    unstable : int
        Number of growing modes.
    proved : int
        Number of proved ones. Each frequency is proved; completeness only if all growing modes are.

    Examples
    --------
    >>> pins = [(place, dof) for place in (0.0, 0.5) for dof in ("u", "v")]
    >>> flat = SpinningBeam([SpinningSegment(0.5, 1e4, 2e4, 15.0)], held=pins)
    >>> f_x, f_y = (np.pi / (2 * 0.5**2) * np.sqrt(rigidity / 15.0) for rigidity in (2e4, 1e4))
    >>> spinning_frequencies(flat, 1, 60 * (f_x + f_y) / 2)
    Traceback (most recent call last):
        ...
    dsm.spinning.frequencies.UnstableSpinError: 1 mode(s) are unstable at speed_rpm=11749.8 ...
    """

    def __init__(self, message: str, frequency: Floats, unstable: int, proved: int) -> None:
        super().__init__(message)
        self.frequency = frequency
        """Lowest frequencies of the other modes (Hz)."""
        self.unstable = unstable
        """Number of growing modes."""
        self.proved = proved
        """Number of proved growing modes."""


def spinning_frequencies(beam: SpinningBeam, count: int, speed_rpm: float) -> Floats:
    """Compute the lowest natural frequencies of a spinning beam in the frame that rotates with it.

    Euler-Bernoulli theory: no rotary inertia, no gyroscopic moments. A round
    beam is solved as two planar ones, of frequencies f_n: |f_n -+ speed_rpm/60|. Otherwise each mode is proved by
    its step of the number of negative eigenvalues of the stiffness matrix, and completeness by their sum
    (see spinning_modes).

    Parameters
    ----------
    beam : SpinningBeam
        Supported beam.
    count : int
        Number of frequencies.
    speed_rpm : float
        Speed of spin (rpm), >= 0.

    Returns
    -------
    ndarray, shape (count,)
        Natural frequencies (Hz), ascending.

    Raises
    ------
    ValueError
        For a count below 1, a negative speed or a beam that can move without bending.
    UnstableSpinError
        If modes grow.
    ArithmeticError
        At a critical speed of a beam that is not round, and if modes cannot be proved.

    Examples
    --------
    A round pinned beam, of f_1 = 162.2 Hz without rotation, seen from the shaft at 3000 rpm: f_1 -+ 50 Hz.

    >>> pins = [(place, dof) for place in (0.0, 0.5) for dof in ("u", "v")]
    >>> beam = SpinningBeam([SpinningSegment(0.5, 1e4, 1e4, 15.0)], held=pins)
    >>> round(float(np.pi / (2 * 0.5**2) * np.sqrt(1e4 / 15.0)), 1)  # Hz
    162.2
    >>> spinning_frequencies(beam, 2, 3000.0).round(1).tolist()
    [112.2, 212.2]
    """
    if count < 1:
        raise ValueError(f"{count} modes requested. Request at least 1 mode.")
    spin = angular_speed(speed_rpm)
    if not beam.is_supported:
        raise ValueError("the beam can move as a rigid body in one plane. Hold more of the dof, or add springs.")
    if beam.is_round:
        return _round_beam_frequencies(beam, count, spin) / (2 * np.pi)
    w, proved, unstable = spinning_modes(beam, count, spin)
    frequency = w / (2 * np.pi)
    if unstable:
        raise UnstableSpinError(
            f"{unstable} mode(s) are unstable at speed_rpm={speed_rpm:g} ({proved} verified by counting). "
            "Choose a speed below the critical speeds, or use the other modes in `frequency` of this error.",
            frequency,
            unstable,
            proved,
        )
    return frequency


def _round_beam_frequencies(beam: SpinningBeam, count: int, spin: float) -> Floats:
    """Return |w_n - W| and w_n + W (rad/s) of so many planar modes that no later one can be lower."""
    n = count
    while True:
        planar = spinning_modes(beam, 2 * n, 0.0)[0][::2]
        w = np.sort(np.concatenate([np.abs(planar - spin), planar + spin]))[:count]
        if planar[-1] - spin >= w[-1]:
            return w
        n *= 2
