"""Spinning beam of any cross-section, its elements and its dynamic stiffness."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Floats, Indices, require_number
from dsm.elements.element_series import MAX_ELEMENT_X, SERIES_TERMS, element_series

SpinningDof = Literal["u", "v", "u'", "v'"]
"""Deflections along the axes x and y of the section, and their slopes du/dz and dv/dz."""


@dataclass(frozen=True)
class SpinningSegment:
    """Uniform piece of the beam, with principal axes x and y parallel to those of all others."""

    length: float
    """Length along the beam (m)."""
    rigidity_xx: float
    """Bending stiffness EIxx about the x axis, against deflection v along y (N m^2)."""
    rigidity_yy: float
    """Bending stiffness EIyy about the y axis, against deflection u along x (N m^2)."""
    mass_per_length: float
    """Mass per length (kg/m)."""


@dataclass(frozen=True)
class SpinningSpring:
    """Spring to the axis of spin that rotates with the beam; with equal stiffnesses it may as well be fixed."""

    position: float
    """Distance from the first end (m)."""
    stiffness_x: float
    """Stiffness against u (N/m)."""
    stiffness_y: float | None = None
    """Stiffness against v (N/m); None: the same."""


@dataclass(frozen=True)
class SpinningBeam:
    """Segments from z = 0 on, springs, and held dofs; all other dofs are free.

    Raises
    ------
    ValueError
        For numbers out of range or places off the beam; the message names the segment or spring (1 is the first).

    Examples
    --------
    >>> clamp = [(0.0, dof) for dof in ("u", "v", "u'", "v'")]
    >>> cantilever = SpinningBeam([SpinningSegment(0.5, 1e4, 1e4, 15.0)], held=clamp)
    >>> spinning_frequencies(cantilever, 1, 0.0).round(2).tolist()  # Hz
    [57.79]
    >>> round(1.87510407**2 / (2 * np.pi * 0.5**2) * (1e4 / 15.0) ** 0.5, 2)  # cos x cosh x = -1
    57.79
    """

    segments: Sequence[SpinningSegment]
    """Segments in order; kept as a tuple."""
    springs: Sequence[SpinningSpring] = ()
    """Springs in any order; those at one place add up; kept as a tuple."""
    held: Sequence[tuple[float, SpinningDof]] = ()
    """Position (m) and name of each held dof: "u" and "v" are a pin, all four a clamp; kept as a tuple."""

    def __post_init__(self) -> None:
        """Check numbers and geometry."""
        for name in ("segments", "springs", "held"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.segments:
            raise ValueError("the beam has no segments. Give at least one segment.")
        for number, segment in enumerate(self.segments, 1):
            for name in ("length", "rigidity_xx", "rigidity_yy", "mass_per_length"):
                require_number(f"segment {number}: {name}", getattr(segment, name), positive=True)
        for number, spring in enumerate(self.springs, 1):
            self._check_spring(f"spring {number}: ", spring)
        for position, dof in self.held:
            self._check_place("held: ", position)
            if dof not in get_args(SpinningDof):
                raise ValueError(f"held: dof={dof!r} is not one of {', '.join(get_args(SpinningDof))}")

    @property
    def length(self) -> float:
        """Length of the beam (m)."""
        return math.fsum(segment.length for segment in self.segments)

    @property
    def is_round(self) -> bool:
        """True if x and y are equivalent: any two perpendicular axes would do."""
        return (
            all(segment.rigidity_xx == segment.rigidity_yy for segment in self.segments)
            and all(spring.stiffness_y in (None, spring.stiffness_x) for spring in self.springs)
            and self._supports("u") == self._supports("v")
        )

    @property
    def is_supported(self) -> bool:
        """True if nothing moves without bending or straining a spring, in either plane."""
        planes = [self._supports(axis) for axis in ("u", "v")]
        return all(len(held) > 1 and any(not is_slope for _, is_slope in held) for held in planes)

    def stiffness(self, spring: SpinningSpring) -> Iterator[tuple[SpinningDof, float]]:
        """Yield the stiffness that a spring adds to u and to v (N/m).

        Parameters
        ----------
        spring : SpinningSpring
            Spring of the beam.
        """
        yield "u", spring.stiffness_x
        yield "v", spring.stiffness_x if spring.stiffness_y is None else spring.stiffness_y

    def _supports(self, axis: str) -> set[tuple[float, bool]]:
        """Return where u or v is held or sprung (False) and where its slope is held (True)."""
        held = {(position, dof.endswith("'")) for position, dof in self.held if dof[0] == axis}
        sprung = (s.position for s in self.springs for dof, k in self.stiffness(s) if dof == axis and k > 0)
        return held | {(position, False) for position in sprung}

    def _check_spring(self, where: str, spring: SpinningSpring) -> None:
        self._check_place(where, spring.position)
        for dof, value in self.stiffness(spring):
            axis = "x" if dof == "u" else "y"
            require_number(f"{where}stiffness_{axis}", value, note=". For a rigid support, hold this dof.")

    def _check_place(self, where: str, position: float) -> None:
        if not 0 <= position <= self.length * (1 + 1e-9):
            raise ValueError(f"{where}position={position} m is not on the beam (0 to {self.length:g} m)")


@dataclass(frozen=True, eq=False)
class SpinningChain:
    """Stiffness matrix K(w) of uniform elements in a row, on springs, in the frame that rotates with them at W (rad/s).

    Every node has the dofs u, v, u' = du/dz, v' = dv/dz, in this order, with u = U cos wt and v = V sin wt: then
    E d'''' = M2 d for d = (U, V), E = diag(EIyy, EIxx), M2 = m [[w^2 + W^2, 2 w W], [2 w W, w^2 + W^2]]. The planar
    element of EI = 1, u'''' = q u, is a power series in q without poles below q L^4 = 500 (see element_series),
    sum c_n q^n; so the spinning one is sum c_n (x) E (E^-1 M2)^n: no eigenvectors of the pencil (M2, E) are needed,
    and as all its entries are >= 0 nothing cancels. It holds up to x = L (m (w + W)^2 / min EI)^(1/4) = MAX_ELEMENT_X.
    """

    length: Floats
    """Length of the elements (m), shape (n,)."""
    rigidity: Floats
    """Rigidities EIyy, which resists u, and EIxx, which resists v, of each element (N m^2), shape (n, 2)."""
    mass_per_length: Floats
    """Mass per length (kg/m), shape (n,)."""
    spring: Floats
    """Spring stiffness against each dof (N/m), shape (4 n + 4,)."""
    free: Indices
    """Indices of the dofs that are not held, shape (n_free,)."""

    def matrices(self, w: Floats, spin: float) -> tuple[Floats, Floats]:
        """Return K and dK/dw at w and W = spin (rad/s), both >= 0, shape (n_w, n_free, n_free) each."""
        mass = self.mass_per_length[:, np.newaxis, np.newaxis] / self.rigidity[..., np.newaxis]
        constant = np.full_like(w, spin)
        same, other = w**2 + spin**2, 2 * w * spin
        step = mass * np.array([[same, other], [other, same]]).T[:, np.newaxis]
        slope = 2 * mass * np.array([[w, constant], [constant, w]]).T[:, np.newaxis]
        power, changed = np.broadcast_to(self._rigidity_matrix, step.shape), np.zeros_like(step)
        value, derivative = np.zeros((2, w.size, self.length.size, 4, 2, 4, 2))
        for term in self._planar:
            value += np.einsum("ekl,weab->wekalb", term, power)
            derivative += np.einsum("ekl,weab->wekalb", term, changed)
            power, changed = power @ step, changed @ step + power @ slope
        return self._joined(value) + self._springs, self._joined(derivative)

    def count(self, w: Floats, spin: float) -> Indices:
        """Return the number of negative eigenvalues of K at w and W = spin (rad/s), shape (n_w,)."""
        scale = 1 / np.sqrt(np.diagonal(self.hermite()[0]))
        scaled = self.matrices(w, spin)[0] * np.outer(scale, scale)
        return np.asarray(np.sum(np.linalg.eigvalsh(scaled) < 0, axis=-1), dtype=int)

    def in_plane(self, axis: Literal[0, 1]) -> SpinningChain:
        """Return the chain that moves along u (0) or v (1) only."""
        return replace(self, free=self.free[self.free % 2 == axis])

    def hermite(self) -> tuple[Floats, Floats, Floats]:
        """Return static stiffness S, consistent mass M and coupling C: K is nearly S - (w^2 + W^2) M - 2 w W C."""
        mass = self.mass_per_length[:, np.newaxis, np.newaxis]
        by_mass = ((-self._planar[1], mass * np.eye(2)[::step]) for step in (1, -1))
        inner = (self._planar[0], self._rigidity_matrix), *by_mass
        stiffness, inertia, coupling = (self._joined(np.einsum("ekl,eab->ekalb", *p)[np.newaxis])[0] for p in inner)
        return stiffness + self._springs, inertia, coupling

    @cached_property
    def _springs(self) -> Floats:
        return np.diag(self.spring[self.free])

    @cached_property
    def _rigidity_matrix(self) -> Floats:
        return np.asarray(self.rigidity[:, np.newaxis] * np.eye(2))

    @cached_property
    def _planar(self) -> Floats:
        """Coefficients of q^n of the planar elements of EI = 1, dofs u, u' at both ends, (SERIES_TERMS, n, 4, 4)."""
        one = np.ones_like(self.length)
        a, b, c, d, e, f = element_series(one, one, self.length)
        rows = np.array([[a, b, d, e], [b, c, -e, f], [d, -e, a, -b], [e, f, -b, c]])
        return np.asarray(rows.transpose(3, 2, 0, 1)).reshape(SERIES_TERMS, -1, 4, 4)

    def _joined(self, elements: Floats) -> Floats:
        """Join the matrices of the elements, shape (n_w, n, 4, 2, 4, 2): planar dof, axis."""
        n_w, n = elements.shape[:2]
        matrix = np.zeros((n_w, 4 * n + 4, 4 * n + 4))
        for first, element in enumerate(elements.reshape(n_w, n, 8, 8).swapaxes(0, 1)):
            at = slice(4 * first, 4 * first + 8)
            matrix[:, at, at] += element
        return matrix[:, self.free[:, np.newaxis], self.free]


def spinning_element(
    rigidity_xx: float,
    rigidity_yy: float,
    mass_per_length: float,
    length: float,
    frequency: ArrayLike,
    speed_rpm: float,
) -> Floats:
    """Compute the stiffness matrix of a uniform spinning beam in the frame that rotates with it.

    Rows and columns are u, v, du/dz, dv/dz at z = 0, then the same at z = length; the matrix gives the forces (N) and
    moments (N m) that do work on them, along the same axes at both ends, and is symmetric. The motion is
    u = U cos wt, v = V sin wt; for u = U sin wt, v = V cos wt the coupling of u and v changes its sign. A rotation
    about x is -dv/dz. Beams longer than the series allows are divided into equal parts whose inner dofs are eliminated;
    infinite only at the natural frequencies of the beam clamped at both ends.

    Parameters
    ----------
    rigidity_xx : float
        Bending stiffness EIxx against v (N m^2).
    rigidity_yy : float
        Bending stiffness EIyy against u (N m^2).
    mass_per_length : float
        Mass per length (kg/m).
    length : float
        Length (m).
    frequency : array_like, shape (n,)
        Frequencies in the rotating frame (Hz), >= 0.
    speed_rpm : float
        Speed of spin (rpm), >= 0.

    Returns
    -------
    ndarray, shape (n, 8, 8)
        Dynamic stiffness.

    Raises
    ------
    ValueError
        For numbers out of range.

    References
    ----------
    Equal to A B^-1 of Gaber & Hashemi, Shock and Vibration, 2015, eqs. (1)-(27), with corrected signs
    (docs/paper.md), but also defined at speed 0, at frequency 0 and if the two are equal.

    Examples
    --------
    Without rotation, and at 0 Hz, it is the stiffness of a beam, 12 E I / L^3 for its ends against each other:

    >>> element = spinning_element(1e4, 1e4, mass_per_length=15.0, length=0.5, frequency=[0.0], speed_rpm=0.0)
    >>> element.shape
    (1, 8, 8)
    >>> round(float(element[0, 0, 0]) / (12 * 1e4 / 0.5**3), 9)
    1.0
    """
    numbers = {"rigidity_xx": rigidity_xx, "rigidity_yy": rigidity_yy, "mass_per_length": mass_per_length}
    for name, value in {**numbers, "length": length}.items():
        require_number(name, value, positive=True)
    spin = angular_speed(speed_rpm)
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if w.ndim != 1 or not np.all(np.isfinite(w) & (w >= 0)):
        raise ValueError(f"frequency={frequency!r} is not a list of finite numbers >= 0 (Hz)")
    x = length * (mass_per_length / min(rigidity_xx, rigidity_yy) * (w + spin) ** 2) ** 0.25
    parts = np.maximum(np.ceil(x / MAX_ELEMENT_X), 1).astype(int)
    result = np.empty((w.size, 8, 8))
    for n in np.unique(parts):
        rigidity = np.tile([rigidity_yy, rigidity_xx], (n, 1))
        mass, dofs = np.full(n, mass_per_length), np.arange(4 * n + 4)
        chain = SpinningChain(np.full(n, length / n), rigidity, mass, np.zeros(dofs.size), dofs)
        result[parts == n] = _condense_inner_nodes(chain.matrices(w[parts == n], spin)[0])
    return result


def angular_speed(speed_rpm: float) -> float:
    """Return the speed of spin (rad/s). Raises ValueError for a negative speed."""
    require_number("speed_rpm", speed_rpm)
    return speed_rpm * math.pi / 30


def _condense_inner_nodes(matrix: Floats) -> Floats:
    """Eliminate all nodes but the first and the last."""
    ends = np.r_[0:4, -4:0]
    outer, across, inner = matrix[:, ends[:, np.newaxis], ends], matrix[:, 4:-4, ends], matrix[:, 4:-4, 4:-4]
    reduced = outer - across.swapaxes(1, 2) @ np.linalg.solve(inner, across)
    return np.asarray((reduced + reduced.swapaxes(1, 2)) / 2)
