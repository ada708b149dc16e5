"""Find the lowest natural modes of a spindle, proved complete."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from dsm.arrays import Flags, Floats, Indices
from dsm.matrix.assemble import HeldDof, ShaftRequest, assemble_request, shared_spin_limit
from dsm.matrix.dynamic_stiffness import DynamicStiffness, count_modes_below
from dsm.modes.eigensolvers import finite_element_modes, newton_step, quadratic_form, whirling_modes
from dsm.modes.modes import Modes
from dsm.spindle.sections import sections
from dsm.spindle.spindle import Spindle

MODE_INTERVAL_WIDTH = 2e-10
"""Relative half-width, in w^2 (w if spinning), of the interval that is proved to contain each mode."""
MODE_ROUNDING = 1024 * np.finfo(np.float64).eps
"""Half-width from rounding, relative to |phi|^T |K| |phi| of a mode of unit modal mass."""
MAX_MODE_INTERVAL = 0.1
"""Largest interval over its w^2 that proves a mode."""
MAX_DIRECT_INTERVAL = 1e-5
"""Largest interval without links: the error is about 1e-4 of the interval."""

MODE_STEP_TOLERANCE = 1e-8
"""Relative change of the last step, after which rounding is larger: each step at least squares the error."""

MAX_MODES = 100
"""Most modes: the work grows with their third power."""

EXTRA_WHIRL_MODES = 12
"""Further modes without rotation that the start values of whirl are made of."""


def find_modes(
    spindle: Spindle, count: int, places: Sequence[float] = (), held: Sequence[HeldDof] = (), spin: float | None = None
) -> Modes:
    """Find the `count` lowest modes, with nodes also at `places` (m) and the dofs `held` fixed (see assemble).

    Hermite elements give start values, inverse iteration with Newton steps on the exact matrix the modes, and two
    Wittrick-Williams counts the proof that mode n is the n-th, with bisection on the count if the proof fails.
    If rounding of the stiffness blurs the modes of a shaft on soft bearings, links are used. Frequencies that
    rounding cannot separate from zero (a free shaft) are 0. spin (rad/s): the modes of forward whirl of a
    supported shaft at this speed; of backward whirl with -spin.

    Raises ValueError for a count outside 1 to MAX_MODES, ArithmeticError if rounding spoils the count.
    """
    if not 1 <= count <= MAX_MODES:
        raise ValueError(f"cannot compute {count} modes. Request 1 to {MAX_MODES}, the range of beam theory.")
    shaft = ShaftRequest(spindle, tuple(map(float, places)), tuple(held), spin=spin)
    try:
        return _solve_modes(shaft, count)
    except _RoundingError:
        return _solve_modes(shaft._replace(links=True), count)


class _RoundingError(ArithmeticError):
    """Raised if rounding makes modes uncertain."""

    def __str__(self) -> str:
        return (
            "the modes of this shaft cannot be computed because of rounding. Check for segments much shorter, thicker "
            "or thinner than the others, and for parts nearly at the same position."
        )


def _solve_modes(shaft: ShaftRequest, count: int) -> Modes:
    try:
        model, eigenvalue, shape = _start_values(shaft, count)
        size = quadratic_form(np.abs(model.dense(eigenvalue)), np.abs(shape))
        width = MODE_INTERVAL_WIDTH * eigenvalue + MODE_ROUNDING * size
        eigenvalue, shape = _refine_modes(model, eigenvalue, shape, width)
        _require_small_rounding(shaft, eigenvalue, width)
        eigenvalue, shape = _verify_modes(model, eigenvalue, shape, width)
    except np.linalg.LinAlgError as exc:
        raise _RoundingError from exc
    node = np.flatnonzero(~model.is_link)
    deflection, slope = shape[:, 2 * node], shape[:, 2 * node + 1]
    frequency = model.to_frequency(eigenvalue)
    return Modes(frequency, model.position[node], deflection, slope, shaft.spindle, shaft.spin or 0.0)


def _start_values(shaft: ShaftRequest, count: int) -> tuple[DynamicStiffness, Floats, Floats]:
    """Return a matrix exact up to the last mode, and the modes of its finite elements."""
    top = _first_guess(shaft.spindle, np.pi * (count + 2))
    for _ in range(8):
        model = assemble_request(shaft, top)
        if shaft.spin is None:
            eigenvalue, shape = finite_element_modes(model, count)
        else:
            shared = shaft._replace(spin=shared_spin_limit(abs(shaft.spin), top))
            eigenvalue, shape = whirling_modes(model, *_modes_at_rest(shared, count + EXTRA_WHIRL_MODES, top), count)
        highest = float(model.to_frequency(eigenvalue[-1:])[0])
        if highest <= model.top_frequency:
            return model, eigenvalue, shape
        top = 2.0 ** (math.ceil(4 * math.log2(highest)) / 4)  # the same for speeds near to each other
    raise _RoundingError


@lru_cache(maxsize=4)
def _modes_at_rest(shaft: ShaftRequest, n: int, top: float) -> tuple[Floats, Floats]:
    """Return the start values for all speeds that share nodes with that of the shaft."""
    model = assemble_request(shaft, top)
    return finite_element_modes(model, min(n, int(np.count_nonzero(~model.held[~model.is_link]))))


@lru_cache(maxsize=32)
def _first_guess(spindle: Spindle, phase: float) -> float:
    """Estimate the frequency (Hz) at which a wave along the shaft has this phase (rad), adding 1/w^2 as Dunkerley."""
    shaft = sections(spindle)
    length, middle = np.diff(shaft.ends), (shaft.ends[1:] + shaft.ends[:-1]) / 2
    section = shaft.at(np.arange(length.size), middle)
    bending = float(np.sum(length * (section.mass / section.rigidity) ** 0.25)) / phase
    if spindle.theory == "euler-bernoulli":
        return 1 / (2 * np.pi * bending**2)
    shear = float(np.sum(length * np.sqrt(section.mass / section.shear))) / phase
    rotary = float(np.sum(length * np.sqrt(section.rotary / section.rigidity))) / phase
    return 1 / (2 * np.pi * float(np.sqrt(bending**4 + shear**2 + rotary**2)))


def _refine_modes(model: DynamicStiffness, eigenvalue: Floats, shape: Floats, width: Floats) -> tuple[Floats, Floats]:
    """Refine all modes at once by inverse iteration with Newton steps, and sort them."""
    for _ in range(8):
        previous = eigenvalue
        eigenvalue, shape = _iterate_once(model, eigenvalue, shape, width)
        if np.all(np.abs(eigenvalue - previous) <= MODE_STEP_TOLERANCE * eigenvalue):
            break
    order = np.argsort(eigenvalue)
    return eigenvalue[order], shape[order]


def _iterate_once(model: DynamicStiffness, eigenvalue: Floats, shape: Floats, width: Floats) -> tuple[Floats, Floats]:
    """Take one step from next to each eigenvalue; shapes phi with -phi^T K' phi = 1, for w^2 the modal mass."""
    trial = eigenvalue + width
    stiffness, slope = model.dense(trial), model.dense(trial, derivative=True)
    improved, moved, energy = newton_step(trial, stiffness, slope, shape, model.solve_singular)
    return improved, moved / np.sqrt(-energy)[:, np.newaxis]


def _require_small_rounding(shaft: ShaftRequest, eigenvalue: Floats, width: Floats) -> None:
    """Raise _RoundingError if rounding makes modes uncertain, or takes them for motions without bending."""
    moving = eigenvalue > width
    still = int(np.sum(~moving))
    doubtful = still > 0 and still > _count_rigid_motions(shaft.spindle, shaft.held, float(np.min(width)))
    widest = MAX_MODE_INTERVAL if shaft.links else MAX_DIRECT_INTERVAL
    if doubtful or np.any(width[moving] > widest * eigenvalue[moving]):
        raise _RoundingError


def _count_rigid_motions(spindle: Spindle, held: Sequence[HeldDof], width: float) -> int:
    """Count the motions without bending, 0 to 2, that neither springs nor held dofs prevent."""
    hindered = [[1.0, z] if dof == 0 else [0.0, 1.0] for z, dof in held]
    for bearing in spindle.bearings:
        if bearing.support_stiffness > width * spindle.mass:
            hindered.append([1.0, bearing.position])
        if bearing.rotational_stiffness > width * spindle.mass * spindle.length**2:
            hindered.append([0.0, 1.0])
    return 2 - int(np.linalg.matrix_rank(hindered) if hindered else 0)


def _verify_modes(model: DynamicStiffness, eigenvalue: Floats, shape: Floats, width: Floats) -> tuple[Floats, Floats]:
    """Return the modes that are proved; the others are found again by counting."""
    eigenvalue = np.where(eigenvalue > width, eigenvalue, 0.0)
    missed = ~_are_certified(model, eigenvalue, width)
    if np.any(missed):
        width = width[missed]
        proved = _bisect_modes(model, np.flatnonzero(missed) + 1, width)
        nearby, shape[missed] = _iterate_once(model, proved, shape[missed], width)
        eigenvalue[missed] = np.clip(nearby, np.maximum(proved - width, 0.0), proved + width)
    return eigenvalue, shape


def _are_certified(model: DynamicStiffness, eigenvalue: Floats, width: Floats) -> Flags:
    """Return for mode n whether fewer than n modes are below its interval, and n or more below its end."""
    below, up_to = count_modes_below(model, np.concatenate([eigenvalue - width, eigenvalue + width])).reshape(2, -1)
    order = np.arange(1, eigenvalue.size + 1)
    return np.asarray((below < order) & (order <= up_to))


def _bisect_modes(model: DynamicStiffness, order: Indices, width: Floats) -> Floats:
    """Return the eigenvalues of the modes with these numbers (1 is the first), by counting alone."""
    low = -width
    high = np.full(order.size, float(model.to_eigenvalue(np.array(model.top_frequency))))
    if np.any(count_modes_below(model, low) >= order) or np.any(count_modes_below(model, high) < order):
        raise _RoundingError
    while np.any(high - low > width):
        middle = (low + high) / 2
        above = count_modes_below(model, middle) < order
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.asarray(np.maximum((low + high) / 2, 0.0), dtype=np.float64)
