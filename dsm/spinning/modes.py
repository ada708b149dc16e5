"""The lowest modes of a spinning beam at one speed, proved complete by counting."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigh

from dsm.elements.element_series import MAX_X
from dsm.modes.newton_step import newton_step, quadratic
from dsm.spindle.places import nearest
from dsm.spinning.beam import Dof, SpinningBeam
from dsm.spinning.chain import SpinningChain

_Float = NDArray[np.float64]

CERTAINTY = 1e-10
"""Relative half-width, in w, of the interval in which each mode is proved to lie."""
ROUNDING = 16 * np.finfo(np.float64).eps
"""The same from rounding, relative to |phi|^T |K| |phi| of a mode with |phi^T (dK/dw) phi| = 1."""
FINENESS = (MAX_X, 1.0, 0.5)
"""Longest x of an element (see SpinningChain), tried in turn; the Hermite elements of the start err by w x^4/1440."""
BLURRED = 1e-3
"""Half-width, relative to w + W, beyond which a mode counts as not proved."""
SAME_PLACE = 1e-6
"""Places nearer to each other than this part of the length are one."""
OFFSET: dict[Dof, int] = {"u": 0, "v": 1, "u'": 2, "v'": 3}


def spinning_modes(beam: SpinningBeam, count: int, spin: float) -> tuple[_Float, int, int]:
    """The `count` lowest w (rad/s) that last, seen in the frame turning at `spin` (rad/s), ascending.

    With them how many other modes grow instead: surely, and all in all. Where the two numbers are equal, no mode is
    missed. Let n(w) be the number of negative eigenvalues of K(w). A mode phi steps it by +1 where its energy,
    -phi^T (dK/dw) phi, is positive, and by -1 where it is negative, which needs w < W. n(0) = n_u + n_v, the numbers
    of planar natural frequencies of the two planes below W. Of these n(0) negative squares of the energy each mode of
    negative energy takes two and each growing mode one, and |n_u - n_v| modes at least do grow (with u = U exp(st),
    v = V exp(st) the count goes from that of the one plane to that of the other as s rises from 0). So min(n_u, n_v)
    modes of negative energy, each proved by its step, are all there are, and nothing is missed between the steps.
    Below all critical speeds n(w) simply is the number of modes below w (Wittrick and Williams). With fewer modes of
    negative energy the others have met modes of positive energy, and the pairs grow (flutter): that these are not
    merely overlooked is what the Hermite elements of the start say, not a proof.

    Raises ArithmeticError at a critical speed and where the steps do not prove the modes.
    """
    modes = None
    for fineness in FINENESS:
        try:
            chain, w, shape = _start(beam, count, spin, fineness)
            planes = _critical_below(chain, spin)
            w, sign, width = _refine(chain, w, shape, spin)
        except np.linalg.LinAlgError:
            continue
        if _steps(chain, w, sign, width, spin, sum(planes)):
            modes = w[:count], abs(planes[0] - planes[1]), sum(planes) - 2 * int(np.sum(sign < 0))
            if modes[1] == modes[2]:
                break
    if modes is None:
        raise ArithmeticError(
            f"the modes at speed_rpm={spin * 30 / np.pi:g} cannot be proved: two meet, or rounding spoils them; try a "
            "speed beside, and look for springs or segment ends far too close together"
        )
    return modes


def _start(beam: SpinningBeam, count: int, spin: float, fineness: float) -> tuple[SpinningChain, _Float, _Float]:
    """A matrix exact up to the last mode wanted, and the modes of its Hermite elements."""
    waves = sum(s.length * (s.mass_per_length / max(s.rigidity_xx, s.rigidity_yy)) ** 0.25 for s in beam.segments)
    top = (np.pi * (count / 2 + 1) / waves) ** 2
    for _ in range(8):
        chain = _assemble(beam, spin + top, fineness)
        w, shape = _hermite_modes(chain, count, spin, top)
        if w.size >= count and w[-1] <= top:
            return chain, w, shape
        top = max(2 * top, 1.01 * np.max(w, initial=0.0))
    raise np.linalg.LinAlgError("no frequency is high enough for all modes wanted")


def _assemble(beam: SpinningBeam, top: float, fineness: float) -> SpinningChain:
    """Nodes at segment ends, springs and held dofs, elements short enough for w + W up to `top` (rad/s)."""
    ends = np.cumsum([0.0] + [segment.length for segment in beam.segments])
    node = ends
    for place in [spring.position for spring in beam.springs] + [position for position, _ in beam.held]:
        if np.min(np.abs(node - place)) > SAME_PLACE * ends[-1]:
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
            spring[_index(position, given.position, dof)] += stiffness
    held = [_index(position, place, dof) for place, dof in beam.held]
    free = np.setdiff1d(np.arange(spring.size), held)
    return SpinningChain(length, np.repeat(rigidity, parts, axis=0), np.repeat(mass, parts), spring, free)


def _index(position: _Float, place: float, dof: Dof) -> int:
    return 4 * nearest(position, place) + OFFSET[dof]


def _hermite_modes(chain: SpinningChain, count: int, spin: float, top: float) -> tuple[_Float, _Float]:
    """w and shapes of (S - (w^2 + W^2) M - 2 w W C) phi = 0: the lowest, and all that may have negative energy.

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


def _critical_below(chain: SpinningChain, spin: float) -> tuple[int, int]:
    """Number of planar natural frequencies below W, in the planes of u and of v."""
    at = np.zeros(1)
    planes = [chain.in_plane(0), chain.in_plane(1)]
    below = [int(plane.count(at, spin * (1 - CERTAINTY))[0]) for plane in planes]
    if below != [int(plane.count(at, spin * (1 + CERTAINTY))[0]) for plane in planes]:
        raise ArithmeticError(
            f"speed_rpm={spin * 30 / np.pi:.12g} is a critical speed, where a frequency falls to zero and cannot be "
            "proved; choose a speed below or above"
        )
    return below[0], below[1]


def _refine(chain: SpinningChain, w: _Float, shape: _Float, spin: float) -> tuple[_Float, _Float, _Float]:
    """Inverse iteration with a Newton step each, all modes at once: w, sign of the energy, and half-width; sorted."""
    width = CERTAINTY * w
    for _ in range(8):
        previous, trial = w, w + width
        stiffness, slope = chain.matrices(trial, spin)
        w, moved, energy = newton_step(trial, stiffness, slope, shape, np.linalg.solve)
        w, sign, shape = np.abs(w), np.sign(-energy), moved / np.sqrt(np.abs(energy))[:, np.newaxis]
        rounding = ROUNDING * quadratic(np.abs(stiffness), np.abs(shape))
        width = CERTAINTY * w + rounding
        if np.all(np.abs(w - previous) <= 1e-12 * w + rounding):
            break
    order = np.argsort(w)
    return w[order], sign[order], width[order]


def _steps(chain: SpinningChain, w: _Float, sign: _Float, width: _Float, spin: float, at_0: int) -> bool:
    """Whether the count steps by the sign of each mode in its own interval and nowhere else."""
    close = np.abs(np.subtract.outer(w, w)) <= width + width[:, np.newaxis]
    if np.any(close & (np.multiply.outer(sign, sign) < 0)) or np.any(width > BLURRED * (w + spin)):
        return False
    edge = np.concatenate([w - width, w + width])
    edge = edge[edge > 0]
    expected = at_0 + (np.less.outer(w, edge).T * sign).sum(axis=1)
    return bool(np.all(chain.count(edge, spin) == expected))
