"""The modes of tool tip and cut as one system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition import Frf
from lobes.tip_response import check_modes
from modal import Mode

UNDERDAMPED = 0.99
"""A complex constant with a larger damping ratio, as a draw may have it, is taken as if with this one."""


@dataclass(frozen=True, eq=False)
class MillingSystem:
    """n modes in the p directions that give way: q'' + 2 zeta w q' + w^2 q = shape vector . F.

    The tip shows d = sum shape vector (place q + velocity q' / w): see `seen_at_tip`. Real modes show shape vector q.
    """

    frequency: NDArray[np.float64]
    """Natural frequencies w (rad/s), shape (n,)."""
    damping_ratio: NDArray[np.float64]
    """Damping ratios zeta, shape (n,)."""
    shape: NDArray[np.float64]
    """Mass-normalised mode shapes at the tool tip, w / sqrt(K) (kg^-1/2), shape (n,)."""
    phase: NDArray[np.float64]
    """Phases of the modal constants (rad), shape (n,); 0 for real modes."""
    direction: NDArray[np.int64]
    """Row of `axes` in which each mode was tapped, shape (n,)."""
    vector: NDArray[np.float64]
    """Directions of the modes in `axes`, shape (n, p): what each takes of a force, and shows. 1 and 0 along an axis."""
    axes: NDArray[np.int64]
    """Directions that give way, 0 for x (feed) and 1 for y (normal), shape (p,)."""

    def receptance(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Receptance (m/N) at frequencies (Hz) of any shape, shape (..., p, p)."""
        omega = 2 * np.pi * frequency
        total = np.zeros((*omega.shape, self.axes.size, self.axes.size), dtype=np.complex128)
        shares = seen_at_tip(self.damping_ratio, self.phase)
        modes = zip(self.frequency, self.damping_ratio, self.shape, *shares, self.vector, strict=True)
        for w, zeta, shape, place, velocity, vector in modes:
            shown = shape**2 * (place + 1j * velocity * omega / w if velocity else place)
            flexible = np.asarray(shown / (w**2 - omega**2 + 2j * zeta * w * omega))
            total += flexible[..., np.newaxis, np.newaxis] * np.outer(vector, vector)
        return total


def seen_at_tip(
    damping_ratio: NDArray[np.float64], phase: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What the tip shows of a mode's coordinate q and of its velocity q' / w, for phases (rad); 1 and 0 for phase 0.

    y = (cos + sin zeta / sqrt(1 - zeta^2)) q + sin / sqrt(1 - zeta^2) q' / w has the receptance of `modal.Mode`.
    """
    velocity = np.sin(phase) / np.sqrt(1 - np.minimum(damping_ratio, UNDERDAMPED) ** 2)
    return np.cos(phase) + velocity * damping_ratio, velocity


def milling_system(
    x: Sequence[Mode] | None, y: Sequence[Mode] | None, vectors: ArrayLike | None = None
) -> MillingSystem:
    """The system of the modes in the feed (x) and normal (y) direction; None for one that is rigid or not known.

    vectors: parts in x and y of what each mode of x, then of y, takes of a force and shows, shape (n, 2); a unit vector
    where its stiffness is that along its own axis. None: each lies in its direction. Raises ValueError for FRFs, for
    two rigid directions, an empty list, modes of negative stiffness, and vectors that do not fit the modes.

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> system = milling_system([mode], [mode])
    >>> at_resonance = system.receptance(np.array(500.0))  # m/N, (2, 2): 1 / (2 i zeta K) on the diagonal
    >>> (at_resonance * 2 * 0.02 * 2e7).round(6).tolist()
    [[-1j, 0j], [0j, -1j]]
    """
    given = [(axis, name, modes) for axis, name, modes in ((0, "x", x), (1, "y", y)) if modes is not None]
    if not given:
        raise ValueError("x and y are both None; give the modes of one direction at least")
    for _, name, modes in given:
        if isinstance(modes, Frf):
            raise ValueError(f"{name} is an FRF; semi-discretisation works on modes: find them with modal.fit_modes")
        check_modes(modes, name)
    modes = [mode for _, _, group in given for mode in group]
    direction = np.repeat(np.arange(len(given)), [len(group) for _, _, group in given])
    axes = np.array([axis for axis, _, _ in given])
    vector = np.eye(axes.size)[direction] if vectors is None else checked_vectors(vectors, len(modes))
    frequency = 2 * np.pi * np.array([mode.frequency for mode in modes])
    return MillingSystem(
        frequency=frequency,
        damping_ratio=np.array([mode.damping_ratio for mode in modes]),
        shape=frequency / np.sqrt([mode.stiffness for mode in modes]),
        phase=np.radians([mode.phase_deg for mode in modes]),
        direction=direction if vectors is None else axes[direction],
        vector=vector,
        axes=axes if vectors is None else np.arange(2),
    )


def checked_vectors(vectors: ArrayLike, number: int) -> NDArray[np.float64]:
    """Directions of so many modes, shape (n, 2); ValueError where they are none."""
    vector = np.asarray(vectors, dtype=np.float64)
    if vector.shape != (number, 2):
        raise ValueError(
            f"vectors has shape {vector.shape}; ({number}, 2) is needed, the parts in x and y of each mode"
        )
    if not np.all(np.isfinite(vector)):
        raise ValueError("vectors holds a value that is not finite; give the parts in x and y of each mode")
    return vector
