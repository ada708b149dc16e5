"""The lowest natural modes, none missed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from dsm.assemble import Held, assemble, section_properties
from dsm.count_below import count_below
from dsm.dynamic_stiffness import DynamicStiffness
from dsm.modes import Modes
from dsm.spindle import Spindle

_Float = NDArray[np.float64]

CERTAINTY = 2e-10
"""Relative half-width, in w^2, of the interval in which each mode is proved to lie."""
ROUNDING = 1024 * np.finfo(np.float64).eps
"""The same from rounding, relative to |phi|^T |K| |phi| of a mode of unit modal mass."""

SPOILT = "rounding spoils the modes of this shaft; look for segments far too short, thick or thin beside the others"


def find_modes(spindle: Spindle, count: int, places: Sequence[float] = (), held: Sequence[Held] = ()) -> Modes:
    """The `count` lowest modes, with nodes also at `places` (m) and the dofs `held` fixed (see assemble).

    Hermite elements give a start, inverse iteration with Newton steps on the exact matrix the modes, and two
    Wittrick-Williams counts the proof that mode n is the n-th; bisection on the count where the proof fails.
    Frequencies that rounding cannot tell from zero (a free shaft) are 0.

    Raises ValueError for a count below 1, ArithmeticError where rounding spoils the count.
    """
    if count < 1:
        raise ValueError(f"{count} modes were asked for; at least 1 is needed")
    try:
        model, w2, shape = _start(spindle, count, places, held)
        width = CERTAINTY * w2 + ROUNDING * _quadratic(np.abs(model.dense(w2)), np.abs(shape))
        w2, shape = _refine(model, w2, shape, width)
        w2, shape = _prove(model, w2, shape, width)
    except np.linalg.LinAlgError as exc:
        raise ArithmeticError(SPOILT) from exc
    return Modes(np.sqrt(w2) / (2 * np.pi), model.position, shape[:, ::2], shape[:, 1::2])


def _start(
    spindle: Spindle, count: int, places: Sequence[float], held: Sequence[Held]
) -> tuple[DynamicStiffness, _Float, _Float]:
    """A matrix exact up to the last mode, and the modes of the Hermite elements, whose w^2 are upper bounds."""
    rigidity, mass = section_properties(spindle)
    length = np.array([segment.length for segment in spindle.segments])
    top = (np.pi * (count + 2) / np.sum(length * (mass / rigidity) ** 0.25)) ** 2 / (2 * np.pi)
    for _ in range(8):
        model = assemble(spindle, top, places, held)
        w2, shape = _hermite_modes(model, count)
        highest = np.sqrt(w2[-1]) / (2 * np.pi)
        if highest <= top:
            return model, w2, shape
        top = 1.01 * highest
    raise ArithmeticError(SPOILT)


def _hermite_modes(model: DynamicStiffness, count: int) -> tuple[_Float, _Float]:
    """w^2 (count,) and shapes (count, 2 n_nodes) of the finite elements that terms 0 and 1 of the series are.

    Solved for 1/(w^2 + shift), so that the lowest modes are the most exact and a free shaft is no exception.
    """
    free = np.flatnonzero(~model.held.ravel())
    mass = -model.dense(np.zeros(1), derivative=True)[0][np.ix_(free, free)]
    shift = 1e-3 * (2 * np.pi * model.top_frequency) ** 2
    shifted = model.dense(np.zeros(1))[0][np.ix_(free, free)] + shift * mass
    inverse, vectors = eigh(mass, shifted, subset_by_index=[free.size - count, free.size - 1])
    shape = np.zeros((count, model.held.size))
    shape[:, free] = (vectors / np.sqrt(inverse)).T[::-1]
    return np.maximum(1 / inverse[::-1] - shift, 0.0), shape


def _refine(model: DynamicStiffness, w2: _Float, shape: _Float, width: _Float) -> tuple[_Float, _Float]:
    """Inverse iteration with a Newton step each, all modes at once; sorted."""
    for _ in range(8):
        previous = w2
        w2, shape = _iterate(model, w2, shape, width)
        if np.all(np.abs(w2 - previous) <= 1e-12 * w2):
            break
    order = np.argsort(w2)
    return w2[order], shape[order]


def _iterate(model: DynamicStiffness, w2: _Float, shape: _Float, width: _Float) -> tuple[_Float, _Float]:
    """One step beside w^2, where K is not singular; shapes phi with -phi^T (dK/d w^2) phi = 1, the exact modal mass."""
    trial = w2 + width
    stiffness, inertia = model.dense(trial), -model.dense(trial, derivative=True)
    moved = np.asarray(np.linalg.solve(stiffness, inertia @ shape[..., np.newaxis])[..., 0], dtype=np.float64)
    scaled = moved / np.sqrt(_quadratic(inertia, moved))[:, np.newaxis]
    return trial + _quadratic(stiffness, scaled), scaled


def _quadratic(matrix: _Float, shape: _Float) -> _Float:
    """phi^T A phi of each mode, shape (n_modes,)."""
    return np.asarray(np.einsum("mi,mij,mj->m", shape, matrix, shape))


def _prove(model: DynamicStiffness, w2: _Float, shape: _Float, width: _Float) -> tuple[_Float, _Float]:
    """The same modes where each is the one it should be; the others found anew by counting."""
    w2 = np.where(w2 > width, w2, 0.0)
    missed = ~_certified(model, w2, width)
    if np.any(missed):
        width = width[missed]
        proved = _bisect(model, np.flatnonzero(missed) + 1, width)
        nearby, shape[missed] = _iterate(model, proved, shape[missed], width)
        w2[missed] = np.clip(nearby, np.maximum(proved - width, 0.0), proved + width)
    return w2, shape


def _certified(model: DynamicStiffness, w2: _Float, width: _Float) -> NDArray[np.bool_]:
    """For mode n: whether fewer than n modes lie below w^2 - width, and n or more below w^2 + width."""
    below, up_to = count_below(model, np.concatenate([w2 - width, w2 + width])).reshape(2, -1)
    order = np.arange(1, w2.size + 1)
    return np.asarray((below < order) & (order <= up_to))


def _bisect(model: DynamicStiffness, order: NDArray[np.int_], width: _Float) -> _Float:
    """w^2 of the modes with these numbers (1 is the first), each within its width, by counting alone."""
    low = -width
    high = np.full(order.size, (2 * np.pi * model.top_frequency) ** 2)
    if np.any(count_below(model, low) >= order) or np.any(count_below(model, high) < order):
        raise ArithmeticError(SPOILT)
    while np.any(high - low > width):
        middle = (low + high) / 2
        above = count_below(model, middle) < order
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.asarray(np.maximum((low + high) / 2, 0.0), dtype=np.float64)
