"""The lowest natural modes, none missed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from dsm.matrix.assemble import Held, assemble
from dsm.matrix.count_below import count_below
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.modes.modes import Modes
from dsm.spindle.sections import sections
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]

CERTAINTY = 2e-10
"""Relative half-width, in w^2 (w where it spins), of the interval in which each mode is proved to lie."""
ROUNDING = 1024 * np.finfo(np.float64).eps
"""The same from rounding, relative to |phi|^T |K| |phi| of a mode of unit modal mass."""
BLURRED = 0.1
"""An interval wider than this part of its w^2 proves nothing worth having."""

SETTLED = 1e-8
"""Relative change of x by a step that leaves less than rounding to the next: each step at least squares the error."""

SPOILT = (
    "rounding spoils the modes of this shaft; look for segments far too short, thick or thin beside the others, and "
    "for bearings, masses or joints far too close to each other or to the end of a segment"
)


def find_modes(
    spindle: Spindle,
    count: int,
    places: Sequence[float] = (),
    held: Sequence[Held] = (),
    spin: float | None = None,
) -> Modes:
    """The `count` lowest modes, with nodes also at `places` (m) and the dofs `held` fixed (see assemble).

    Hermite elements give a start, inverse iteration with Newton steps on the exact matrix the modes, and two
    Wittrick-Williams counts the proof that mode n is the n-th; bisection on the count where the proof fails.
    Frequencies that rounding cannot tell from zero (a free shaft) are 0. spin (rad/s): the modes of forward whirl of a
    supported shaft that spins so fast; of backward whirl with -spin.

    Raises ValueError for a count below 1, ArithmeticError where rounding spoils the count.
    """
    if count < 1:
        raise ValueError(f"{count} modes were asked for; at least 1 is needed")
    try:
        model, x, shape = _start(spindle, count, places, held, spin)
        width = CERTAINTY * x + ROUNDING * _quadratic(np.abs(model.dense(x)), np.abs(shape))
        x, shape = _refine(model, x, shape, width)
        _require_sharp(spindle, held, x, width)
        x, shape = _prove(model, x, shape, width)
    except np.linalg.LinAlgError as exc:
        raise ArithmeticError(SPOILT) from exc
    return Modes(model.to_frequency(x), model.position, shape[:, ::2], shape[:, 1::2], spindle, spin or 0.0)


def _start(
    spindle: Spindle, count: int, places: Sequence[float], held: Sequence[Held], spin: float | None
) -> tuple[DynamicStiffness, _Float, _Float]:
    """A matrix exact up to the last mode, and the modes of its finite elements."""
    top = _first_guess(spindle, np.pi * (count + 2))
    for _ in range(8):
        model = assemble(spindle, top, places, held, spin=spin)
        x, shape = _finite_element_modes(model, count) if spin is None else _whirling_modes(model, count)
        highest = float(model.to_frequency(x[-1:])[0])
        if highest <= model.top_frequency:
            return model, x, shape
        top = highest
    raise ArithmeticError(SPOILT)


def _first_guess(spindle: Spindle, phase: float) -> float:
    """Frequency (Hz) at which a wave along the shaft turns by about `phase` (rad); 1/w^2 adds up as in Dunkerley's."""
    pieces = sections(spindle)
    bending = float(np.sum(pieces.length * (pieces.mass / pieces.rigidity) ** 0.25)) / phase
    if spindle.theory == "euler-bernoulli":
        return 1 / (2 * np.pi * bending**2)
    shear = float(np.sum(pieces.length * np.sqrt(pieces.mass / pieces.shear))) / phase
    rotary = float(np.sum(pieces.length * np.sqrt(pieces.rotary / pieces.rigidity))) / phase
    return 1 / (2 * np.pi * float(np.sqrt(bending**4 + shear**2 + rotary**2)))


def _finite_element_modes(model: DynamicStiffness, count: int) -> tuple[_Float, _Float]:
    """w^2 (count,) and shapes (count, 2 n_nodes) of the finite elements that terms 0 and 1 of the series are.

    Upper bounds. Solved for 1/(w^2 + shift), so that the lowest are the most exact and a free shaft is no exception.
    """
    free = np.flatnonzero(~model.held.ravel())
    if free.size < count:
        raise ArithmeticError(f"{count} modes were asked for; the model of this shaft has {free.size}")
    mass = -model.term(1)[np.ix_(free, free)]
    shift = 1e-3 * (2 * np.pi * model.top_frequency) ** 2
    shifted = model.term(0)[np.ix_(free, free)] + shift * mass
    inverse, vectors = eigh(mass, shifted, subset_by_index=[free.size - count, free.size - 1])
    shape = np.zeros((count, model.held.size))
    shape[:, free] = (vectors / np.sqrt(inverse)).T[::-1]
    return np.maximum(1 / inverse[::-1] - shift, 0.0), shape


def _whirling_modes(model: DynamicStiffness, count: int) -> tuple[_Float, _Float]:
    """The same for a shaft that spins, from terms 0 to 2: K0 + w K1 - w^2 M.

    With y = w x it is diag(K0, M) z = w [[-K1, M], [M, 0]] z, z = (x, y), whose left side is positive definite.
    """
    free = np.flatnonzero(~model.held.ravel())
    terms = [model.term(power)[np.ix_(free, free)] for power in range(3)]
    stiffness, gyroscopic, mass = terms[0], terms[1], -terms[2]
    zero = np.zeros_like(mass)
    right = np.block([[-gyroscopic, mass], [mass, zero]])
    last = 2 * free.size - 1
    inverse, vectors = eigh(
        right, np.block([[stiffness, zero], [zero, mass]]), subset_by_index=[last - count + 1, last]
    )
    if inverse[0] <= 0:
        raise ArithmeticError(f"{count} modes were asked for; the model of this shaft has fewer")
    shape = np.zeros((count, model.held.size))
    shape[:, free] = vectors[: free.size].T[::-1]
    x = 1 / inverse[::-1]
    inertia = -model.dense(x, derivative=True)
    return x, shape / np.sqrt(_quadratic(inertia, shape))[:, np.newaxis]


def _refine(model: DynamicStiffness, x: _Float, shape: _Float, width: _Float) -> tuple[_Float, _Float]:
    """Inverse iteration with a Newton step each, all modes at once; sorted."""
    for _ in range(8):
        previous = x
        x, shape = _iterate(model, x, shape, width)
        if np.all(np.abs(x - previous) <= SETTLED * x):
            break
    order = np.argsort(x)
    return x[order], shape[order]


def _iterate(model: DynamicStiffness, x: _Float, shape: _Float, width: _Float) -> tuple[_Float, _Float]:
    """One step beside x, where K is not singular; shapes phi with -phi^T (dK/dx) phi = 1, for w^2 the modal mass."""
    trial = x + width
    stiffness, inertia = model.dense(trial), -model.dense(trial, derivative=True)
    moved = np.asarray(np.linalg.solve(stiffness, inertia @ shape[..., np.newaxis])[..., 0], dtype=np.float64)
    scaled = moved / np.sqrt(_quadratic(inertia, moved))[:, np.newaxis]
    return trial + _quadratic(stiffness, scaled), scaled


def _quadratic(matrix: _Float, shape: _Float) -> _Float:
    """phi^T A phi of each mode, shape (n_modes,)."""
    return np.asarray(np.sum(shape * (matrix @ shape[..., np.newaxis])[..., 0], axis=1))


def _require_sharp(spindle: Spindle, held: Sequence[Held], x: _Float, width: _Float) -> None:
    """Raise ArithmeticError where rounding leaves modes in doubt, or takes them for motions without bending."""
    moving = x > width
    still = int(np.sum(~moving))
    doubtful = still > 0 and still > _motions(spindle, held, float(np.min(width)))
    if doubtful or np.any(width[moving] > BLURRED * x[moving]):
        raise ArithmeticError(SPOILT)


def _motions(spindle: Spindle, held: Sequence[Held], width: float) -> int:
    """Number of motions without bending, 0 to 2, that no spring worth the name and no held dof hinders."""
    hindered = [[1.0, z] if dof == 0 else [0.0, 1.0] for z, dof in held]
    for bearing in spindle.bearings:
        if bearing.support_stiffness > width * spindle.mass:
            hindered.append([1.0, bearing.position])
        if bearing.rotational_stiffness > width * spindle.mass * spindle.length**2:
            hindered.append([0.0, 1.0])
    return 2 - int(np.linalg.matrix_rank(hindered) if hindered else 0)


def _prove(model: DynamicStiffness, x: _Float, shape: _Float, width: _Float) -> tuple[_Float, _Float]:
    """The same modes where each is the one it should be; the others found anew by counting."""
    x = np.where(x > width, x, 0.0)
    missed = ~_certified(model, x, width)
    if np.any(missed):
        width = width[missed]
        proved = _bisect(model, np.flatnonzero(missed) + 1, width)
        nearby, shape[missed] = _iterate(model, proved, shape[missed], width)
        x[missed] = np.clip(nearby, np.maximum(proved - width, 0.0), proved + width)
    return x, shape


def _certified(model: DynamicStiffness, x: _Float, width: _Float) -> NDArray[np.bool_]:
    """For mode n: whether fewer than n modes lie below x - width, and n or more below x + width."""
    below, up_to = count_below(model, np.concatenate([x - width, x + width])).reshape(2, -1)
    order = np.arange(1, x.size + 1)
    return np.asarray((below < order) & (order <= up_to))


def _bisect(model: DynamicStiffness, order: NDArray[np.int_], width: _Float) -> _Float:
    """x of the modes with these numbers (1 is the first), each within its width, by counting alone."""
    low = -width
    high = np.full(order.size, float(model.to_x(np.array(model.top_frequency))))
    if np.any(count_below(model, low) >= order) or np.any(count_below(model, high) < order):
        raise ArithmeticError(SPOILT)
    while np.any(high - low > width):
        middle = (low + high) / 2
        above = count_below(model, middle) < order
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.asarray(np.maximum((low + high) / 2, 0.0), dtype=np.float64)
