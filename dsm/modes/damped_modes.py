"""Natural modes with damping, followed from the undamped modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsm.arrays import Complexes, Floats
from dsm.matrix.assemble import assemble
from dsm.matrix.condense import damped_blocks
from dsm.matrix.dynamic_stiffness import DynamicStiffness, full_matrices
from dsm.modes.eigensolvers import newton_step
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.attachments import Damping, damping_of_bearings, supports
from dsm.spindle.spindle import Spindle, require_support

INVERSE_ITERATION_OFFSET = 1e-10
"""Relative distance from the frequency at which K, which is singular there, is inverted."""
MAX_NEWTON_ROUNDS = 8
"""Most Newton steps for one step of damping."""
MIN_OSCILLATION_SHARE = 1e-4
"""Least damped frequency over |w| of an oscillating mode."""
DAMPED_MODE_TOLERANCE = 1e-8
"""Last relative change of w; Rayleigh's quotient has cubed the error once more by then."""
MAX_PREDICTION_MISS = 0.2
"""Largest error of the first-order prediction over the predicted change; steps with more are halved."""
MIN_DAMPING_STEP = 2.0**-16
"""Least share of the whole change of damping per step; below it the mode is lost."""


class DampedMode(NamedTuple):
    """Decaying motion phi exp(i w t)."""

    w: complex
    """Complex angular frequency (rad/s), in the first quadrant."""
    shape: Complexes
    """phi, shape (n_dofs,), scaled to phi^T (dK/dw) phi = 1."""

    @property
    def damping_ratio(self) -> float:
        """Damping ratio -Re s/|s| of s = i w (-)."""
        return self.w.imag / abs(self.w)


class DampedShaft(NamedTuple):
    """Dynamic stiffness of a shaft without rotation, at complex w, for any damping."""

    spindle: Spindle
    """Shaft, springs and masses; its dampers are ignored."""
    model: DynamicStiffness
    """Matrix without damping."""
    undamped: Floats
    """Undamped natural frequencies (Hz), shape (n_modes,)."""

    @classmethod
    def of(cls, spindle: Spindle, count: int) -> DampedShaft:
        """Build it with the `count` lowest modes. ValueError for an unsupported shaft and a count below 1."""
        require_support(spindle)
        undamped = natural_frequencies(spindle, count)
        # A damper that locks its bearing raises the frequency towards that of rigid bearings.
        locked = natural_frequencies(spindle, count, rigid_bearings=True)
        return cls(spindle, assemble(spindle, 2 * float(max(undamped[-1], locked[-1]))), undamped)

    @property
    def no_damping(self) -> Damping:
        """Zero damping."""
        return Damping(np.zeros(len(self.spindle.bearings)), 0.0)

    def start(self, number: int) -> DampedMode:
        """Return mode `number` (1 is the lowest) without damping: K(w) phi = 0, by inverse iteration."""
        w = 2 * np.pi * float(self.undamped[number - 1])
        matrices = self.matrices(self.no_damping, w * (1 + INVERSE_ITERATION_OFFSET))
        shape = np.ones(self.model.held.size, dtype=np.complex128)
        for _ in range(2):
            _, shape = self._step(w, *matrices, shape)
        return DampedMode(complex(w), shape)

    def _step(
        self, trial: complex, stiffness: Complexes, by_w: Complexes, shape: Complexes
    ) -> tuple[complex, Complexes]:
        at = np.array([trial], dtype=np.complex128)
        w, moved, energy = newton_step(at, stiffness[None], by_w[None], shape[None], self.model.solve_singular)
        return complex(w[0]), moved[0] / np.sqrt(energy[0])

    def matrices(self, damping: Damping, w: complex) -> tuple[Complexes, Complexes]:
        """Return K(w) and dK/dw, shape (n_dofs, n_dofs) each."""
        at = np.array([w], dtype=np.complex128)
        blocks = (damped_blocks(self.model, self.spindle, at, damping, derivative) for derivative in (False, True))
        stiffness, by_w = (full_matrices(*pair)[0] for pair in blocks)
        return stiffness, by_w

    def damper_sensitivity(self, damping: Damping, mode: DampedMode) -> Complexes:
        """Return dw/dc of the mode for the damper c of each bearing (rad/s per N s/m), shape (n_bearings,)."""
        bearings = self.spindle.bearings
        movable = [index for index, bearing in enumerate(bearings) if np.isfinite(bearing.stiffness)]
        damping = Damping(damping.viscous[movable], damping.loss_factor)
        held = supports([bearings[index] for index in movable], np.array([mode.w]), damping)
        dof = [2 * self.model.node(bearings[index].position) for index in movable]
        change = np.zeros(len(bearings), dtype=np.complex128)
        change[movable] = -1j * mode.w * held.stiffness_slope[0] * mode.shape[dof] ** 2
        return change

    def follow(self, number: int, mode: DampedMode, old: Damping, new: Damping) -> DampedMode:
        """Follow mode `number` from the damping `old` to `new` in steps small enough not to lose it.

        Raises ArithmeticError if it stops oscillating, or merges with another mode, on the way.
        """
        done, step = 0.0, 1.0
        while done < 1:
            step = min(step, 1 - done)
            share = done + step
            viscous = old.viscous + share * (new.viscous - old.viscous)
            moved = self._newton(mode, Damping(viscous, old.loss_factor + share * (new.loss_factor - old.loss_factor)))
            if moved is not None:
                mode, done, step = moved, share, 2 * step
            elif step > MIN_DAMPING_STEP:
                step /= 2
            else:
                raise ArithmeticError(
                    f"mode {number} cannot be followed beyond a damping ratio of {mode.damping_ratio:.3g}. "
                    "Give less bearing damping."
                )
        return mode

    def _newton(self, mode: DampedMode, damping: Damping) -> DampedMode | None:
        """Return the mode at a damping nearby; None if it is not the predicted one."""
        w, shape = mode
        foreseen = w
        for number in range(MAX_NEWTON_ROUNDS):
            trial = w * (1 + INVERSE_ITERATION_OFFSET)
            stiffness, by_w = self.matrices(damping, trial)
            if number == 0:
                foreseen = trial - complex((shape @ stiffness @ shape) / (shape @ by_w @ shape))
            last, (w, shape) = w, self._step(trial, stiffness, by_w, shape)
            if abs(w - last) <= DAMPED_MODE_TOLERANCE * abs(w):
                limit = MAX_PREDICTION_MISS * abs(foreseen - mode.w) + DAMPED_MODE_TOLERANCE * abs(w)
                close = abs(w - foreseen) <= limit
                return DampedMode(w, shape) if close and w.real > MIN_OSCILLATION_SHARE * abs(w) else None
        return None


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Decaying modes exp(s t), each in the place of the undamped mode it comes from."""

    frequency: Floats
    """Natural frequency |s|/2 pi (Hz), shape (n_modes,); not always rising for uneven damping."""
    damping_ratio: Floats
    """Damping ratio zeta = -Re s/|s| (-), shape (n_modes,)."""


def damped_modes(spindle: Spindle, count: int, loss_factor: float = 0.0) -> DampedModes:
    """Compute the lowest modes of the shaft without rotation with bearing dampers and a loss factor, exactly.

    A loss factor alone gives each mode zeta = sin(atan(eta)/2), eta/2 if small. Each certified undamped mode is
    followed
    up to the given damping by Newton steps on the complex matrix K(w), s = i w, from the first-order estimate. A loss
    factor is a model of steady vibration; the more a mode is damped, the less it means.

    Parameters
    ----------
    spindle : Spindle
        Spindle with dampers.
    count : int
        Number of modes.
    loss_factor : float
        Loss factor eta (-): shaft, bearings, housing and joints have the stiffness k (1 + i eta).

    Returns
    -------
    DampedModes
        Frequencies and damping ratios.

    Raises
    ------
    ValueError
        For a count below 1, an unsupported shaft and a loss factor below 0.
    ArithmeticError
        For a mode that stops oscillating.

    Examples
    --------
    A loss factor alone gives every mode half of it as damping ratio, sin(atan(eta) / 2):

    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> damped_modes(spindle, 3, loss_factor=0.04).damping_ratio.round(5).tolist()
    [0.01999, 0.01999, 0.01999]
    >>> round(float(np.sin(np.arctan(0.04) / 2)), 5)
    0.01999
    """
    target = damping_of_bearings(spindle.bearings, loss_factor)
    shaft = DampedShaft.of(spindle, count)
    modes = [shaft.follow(number, shaft.start(number), shaft.no_damping, target) for number in range(1, count + 1)]
    frequency = np.array([abs(mode.w) / (2 * np.pi) for mode in modes])
    return DampedModes(frequency, np.array([mode.damping_ratio for mode in modes]))
