"""A chain of spinning beam elements and its dynamic stiffness matrix."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsm.elements.element_series import TERMS, element_series

_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpinningChain:
    """Stiffness matrix K(w) of uniform elements in a row, on springs, in the frame that turns with them at W (rad/s).

    Every node has the dofs u, v, u' = du/dz, v' = dv/dz, in this order, with u = U cos wt and v = V sin wt: then
    E d'''' = M2 d for d = (U, V), E = diag(EIyy, EIxx), M2 = m [[w^2 + W^2, 2 w W], [2 w W, w^2 + W^2]]. The planar
    element of EI = 1, u'''' = q u, is a power series in q without poles below q L^4 = 500 (see element_series),
    sum c_n q^n; so the spinning one is sum c_n (x) E (E^-1 M2)^n: no eigenvectors of the pencil (M2, E) are needed,
    and as all its entries are >= 0 nothing cancels. It holds up to x = L (m (w + W)^2 / min EI)^(1/4) = MAX_X.
    """

    length: _Float
    """Length of the elements (m), shape (n,)."""
    rigidity: _Float
    """EIyy, which resists u, and EIxx, which resists v, of each element (N m^2), shape (n, 2)."""
    mass_per_length: _Float
    """Mass per length (kg/m), shape (n,)."""
    spring: _Float
    """Stiffness of the springs against each dof (N/m), shape (4 n + 4,)."""
    free: NDArray[np.int_]
    """Indices of the dofs that are not held, shape (n_free,)."""

    def matrices(self, w: _Float, spin: float) -> tuple[_Float, _Float]:
        """K and dK/dw at w and W = spin (rad/s), both >= 0, shape (n_w, n_free, n_free) each."""
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

    def count(self, w: _Float, spin: float) -> NDArray[np.int_]:
        """Number of negative eigenvalues of K at w and W = spin (rad/s), shape (n_w,)."""
        scale = 1 / np.sqrt(np.diagonal(self.hermite()[0]))
        scaled = self.matrices(w, spin)[0] * np.outer(scale, scale)
        return np.asarray(np.sum(np.linalg.eigvalsh(scaled) < 0, axis=-1), dtype=int)

    def in_plane(self, axis: Literal[0, 1]) -> SpinningChain:
        """The same that moves along u (0) or v (1) only."""
        return replace(self, free=self.free[self.free % 2 == axis])

    def hermite(self) -> tuple[_Float, _Float, _Float]:
        """Static stiffness S, consistent mass M and coupling C: K is nearly S - (w^2 + W^2) M - 2 w W C."""
        mass = self.mass_per_length[:, np.newaxis, np.newaxis]
        inner = (
            (self._planar[0], self._rigidity_matrix),
            (-self._planar[1], mass * np.eye(2)),
            (-self._planar[1], mass * np.eye(2)[::-1]),
        )
        stiffness, inertia, coupling = (
            self._joined(np.einsum("ekl,eab->ekalb", *pair)[np.newaxis])[0] for pair in inner
        )
        return stiffness + self._springs, inertia, coupling

    @cached_property
    def _springs(self) -> _Float:
        return np.diag(self.spring[self.free])

    @cached_property
    def _rigidity_matrix(self) -> _Float:
        return np.asarray(self.rigidity[:, np.newaxis] * np.eye(2))

    @cached_property
    def _planar(self) -> _Float:
        """Coefficients of q^n of the planar elements of EI = 1, dofs u, u' at both ends, shape (TERMS, n, 4, 4)."""
        one = np.ones_like(self.length)
        a, b, c, d, e, f = element_series(one, one, self.length)
        rows = np.array([[a, b, d, e], [b, c, -e, f], [d, -e, a, -b], [e, f, -b, c]])
        return np.asarray(rows.transpose(3, 2, 0, 1)).reshape(TERMS, -1, 4, 4)

    def _joined(self, elements: _Float) -> _Float:
        """The matrix of the chain from those of its elements, shape (n_w, n, 4, 2, 4, 2): planar dof, axis."""
        n_w, n = elements.shape[:2]
        matrix = np.zeros((n_w, 4 * n + 4, 4 * n + 4))
        for first, element in enumerate(elements.reshape(n_w, n, 8, 8).swapaxes(0, 1)):
            at = slice(4 * first, 4 * first + 8)
            matrix[:, at, at] += element
        return matrix[:, self.free[:, np.newaxis], self.free]
