"""Modes of a shaft at rest, followed while its damping grows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.matrix.assemble import assemble
from dsm.matrix.damped_blocks import damped_blocks
from dsm.matrix.dynamic_stiffness import DynamicStiffness, full_matrices
from dsm.modes.natural_frequencies import natural_frequencies
from dsm.modes.newton_step import newton_step
from dsm.spindle.spindle import Spindle, require_support
from dsm.spindle.supports import Damping, supports

_Float = NDArray[np.float64]
_Complex = NDArray[np.complex128]

OFFSET = 1e-10
"""Relative distance from the frequency at which K is inverted: it is singular at the frequency itself."""
NEWTON_ROUNDS = 8
"""More are not spent on one step of damping."""
OSCILLATES = 1e-4
"""A mode whose damped frequency is a smaller part of |w| counts as one that has ceased to oscillate."""
SETTLED = 1e-8
"""Last relative change of w; Rayleigh's quotient has cubed the error once more by then."""
FORESEEN = 0.2
"""Largest miss of the prediction of first order, in parts of the predicted change; steps that miss more are halved."""
SMALLEST_STEP = 2.0**-16
"""Part of the whole change of damping; where smaller steps are needed, the mode is lost."""


class DampedMode(NamedTuple):
    """A motion phi exp(i w t) that dies away."""

    w: complex
    """Complex angular frequency (rad/s), in the first quadrant."""
    shape: _Complex
    """phi, shape (n_dofs,), scaled to phi^T (dK/dw) phi = 1."""

    @property
    def damping_ratio(self) -> float:
        """-Re s/|s| of s = i w (-)."""
        return self.w.imag / abs(self.w)


@dataclass(frozen=True, eq=False)
class DampedShaft:
    """The dynamic stiffness of a shaft at rest, at complex w, for any damping."""

    spindle: Spindle
    """Shaft, springs and masses; its dampers are not looked at."""
    model: DynamicStiffness
    """The matrix without damping."""
    undamped: _Float
    """Frequencies of its modes (Hz), shape (n_modes,)."""

    @classmethod
    def of(cls, spindle: Spindle, count: int) -> DampedShaft:
        """With its `count` lowest modes. ValueError for a shaft that is not held and a count below 1."""
        require_support(spindle)
        undamped = natural_frequencies(spindle, count)
        # A damper that locks its bearing raises the frequency towards that of rigid bearings.
        locked = natural_frequencies(spindle, count, rigid_bearings=True)
        return cls(spindle, assemble(spindle, 2 * float(max(undamped[-1], locked[-1]))), undamped)

    @property
    def none(self) -> Damping:
        """No damping."""
        return Damping(np.zeros(len(self.spindle.bearings)), 0.0)

    def start(self, number: int) -> DampedMode:
        """Mode `number` (1 is the lowest) without damping: K(w) phi = 0, by inverse iteration."""
        w = 2 * np.pi * float(self.undamped[number - 1])
        stiffness, by_w = self.matrices(self.none, w * (1 + OFFSET))
        shape = np.ones(self.model.held.size, dtype=np.complex128)
        for _ in range(2):
            _, shape = self._step(w, stiffness, by_w, shape)
        return DampedMode(complex(w), shape)

    def _step(self, trial: complex, stiffness: _Complex, by_w: _Complex, shape: _Complex) -> tuple[complex, _Complex]:
        at = np.array([trial], dtype=np.complex128)
        w, moved, energy = newton_step(
            at, stiffness[np.newaxis], by_w[np.newaxis], shape[np.newaxis], self.model.solve_nearly
        )
        return complex(w[0]), moved[0] / np.sqrt(energy[0])

    def matrices(self, damping: Damping, w: complex) -> tuple[_Complex, _Complex]:
        """K(w) and dK/dw, shape (n_dofs, n_dofs) each."""
        at = np.array([w], dtype=np.complex128)
        stiffness, by_w = (
            full_matrices(*damped_blocks(self.model, self.spindle, at, damping, derivative))[0]
            for derivative in (False, True)
        )
        return stiffness, by_w

    def by_damper(self, damping: Damping, mode: DampedMode) -> _Complex:
        """dw/dc of the mode for the damper c of each bearing (rad/s per N s/m), shape (n_bearings,)."""
        bearings = self.spindle.bearings
        movable = [index for index, bearing in enumerate(bearings) if np.isfinite(bearing.stiffness)]
        held = supports(
            [bearings[index] for index in movable],
            np.array([mode.w]),
            Damping(damping.viscous[movable], damping.loss_factor),
        )
        dof = [2 * self.model.node(bearings[index].position) for index in movable]
        change = np.zeros(len(bearings), dtype=np.complex128)
        change[movable] = -1j * mode.w * held.slope[0] * mode.shape[dof] ** 2
        return change

    def follow(self, number: int, mode: DampedMode, old: Damping, new: Damping) -> DampedMode:
        """Mode `number` at the damping `new`, reached from that at `old` in steps small enough not to lose it.

        Raises ArithmeticError where it stops oscillating, or merges with another mode, on the way.
        """
        done, step = 0.0, 1.0
        while done < 1:
            step = min(step, 1 - done)
            share = done + step
            viscous = old.viscous + share * (new.viscous - old.viscous)
            moved = self._newton(mode, Damping(viscous, old.loss_factor + share * (new.loss_factor - old.loss_factor)))
            if moved is not None:
                mode, done, step = moved, share, 2 * step
            elif step > SMALLEST_STEP:
                step /= 2
            else:
                raise ArithmeticError(
                    f"mode {number} is lost at a damping ratio of {mode.damping_ratio:.3g}: with more damping it stops "
                    "oscillating or merges with another mode; give smaller dampers"
                )
        return mode

    def _newton(self, mode: DampedMode, damping: Damping) -> DampedMode | None:
        """The mode at a damping near by; None where it is not the one that is foreseen."""
        w, shape = mode
        foreseen = w
        for number in range(NEWTON_ROUNDS):
            trial = w * (1 + OFFSET)
            stiffness, by_w = self.matrices(damping, trial)
            if number == 0:
                foreseen = trial - complex((shape @ stiffness @ shape) / (shape @ by_w @ shape))
            last, (w, shape) = w, self._step(trial, stiffness, by_w, shape)
            if abs(w - last) <= SETTLED * abs(w):
                close = abs(w - foreseen) <= FORESEEN * abs(foreseen - mode.w) + SETTLED * abs(w)
                return DampedMode(w, shape) if close and w.real > OSCILLATES * abs(w) else None
        return None
