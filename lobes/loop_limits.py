"""Stability limits of a chatter loop given over frequency."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from acquisition import Remark
from lobes.cut import Cut
from lobes.stability_lobes import Lobe, MethodName, StabilityLobes
from lobes.tip_response import TipResponse
from lobes.tooth_force import mean_regeneration
from modal.arrays import Complexes, Floats, Indices, Integers

MIN_UNEVEN_RESPONSE = 0.02
"""Least response that is searched, over its largest value."""
MIN_STEPS_PER_WAVE = 24
"""Fewest grid frequencies per turn of the regeneration of the longest delay."""
UNEVEN_REFINEMENT_STEPS = 6
"""Steps of the false position that refines a crossing."""
MAX_UNEVEN_GRID_VALUES = 2_000_000
"""Most speeds times frequencies processed at once."""


def uneven_limits(branch: TipResponse, cut: Cut, tooth_frequency: Floats) -> tuple[Floats, Floats]:
    """Return the lowest limit (m) and its frequency (Hz) at each mean tooth frequency (Hz), shape (n,).

    Inf and nan if there is none. b L s = -1 with s = 1 - exp(-i w tau) averaged over the teeth: b = -1 / Re(L s) for
    Im(L s) = 0, Re(L s) < 0.
    Source: Budak, An analytical design method for milling cutters with nonconstant pitch to increase stability,
    J. Manuf. Sci. Eng. 125 (2003) 29-34.
    """
    depth, chatter = np.full(tooth_frequency.shape, np.inf), np.full(tooth_frequency.shape, np.nan)
    for rows, grid in frequency_blocks(branch, cut, tooth_frequency):
        loop = branch.receptance(grid) * mean_regeneration(cut, grid / tooth_frequency[rows, np.newaxis])
        row, step = np.nonzero((loop.imag[:, 1:] < 0) != (loop.imag[:, :-1] < 0))
        loop_at = partial(_loop_response, branch, cut, tooth_frequency[rows][row])
        frequency = _refine_uneven_crossing(loop_at, grid[step], grid[step + 1])
        real = loop_at(frequency).real
        limit = np.where(real < 0, -1 / np.minimum(real, -1e-300), np.inf)
        order = np.lexsort((limit, row))
        first = order[np.flatnonzero(np.diff(row[order], prepend=-1))]
        limited = first[np.isfinite(limit[first])]
        depth[rows[row[limited]]], chatter[rows[row[limited]]] = limit[limited], frequency[limited]
    return depth, chatter


def frequency_blocks(branch: TipResponse, cut: Cut, tooth_frequency: Floats) -> Iterator[tuple[Indices, Floats]]:
    """Yield indices of speeds and the frequencies to be searched for them (Hz)."""
    size = np.abs(branch.on_grid)
    loud = branch.grid[size > MIN_UNEVEN_RESPONSE * np.max(size)]
    longest = max(cut.delays) / (2 * np.pi) * cut.teeth
    order = np.argsort(tooth_frequency)
    for part in np.array_split(order, max(1, order.size // 32)):
        step = tooth_frequency[part[0]] / longest / MIN_STEPS_PER_WAVE
        even = np.arange(max(loud[0], step / MIN_STEPS_PER_WAVE), loud[-1], step)
        grid = np.union1d(even, loud[loud > 0])
        for rows in np.array_split(part, -(-part.size * grid.size // MAX_UNEVEN_GRID_VALUES)):
            yield rows, grid


def _loop_response(branch: TipResponse, cut: Cut, tooth_frequency: Floats, frequency: Floats) -> Complexes:
    return np.asarray(branch.receptance(frequency) * mean_regeneration(cut, frequency / tooth_frequency))


def _refine_uneven_crossing(loop_at: Callable[[Floats], Complexes], low: Floats, high: Floats) -> Floats:
    """Return the frequencies between `low` and `high` (Hz) at which the loop is real."""
    at_low, at_high = loop_at(low).imag, loop_at(high).imag
    for _ in range(UNEVEN_REFINEMENT_STEPS):
        middle = high - at_high * (high - low) / (at_high - at_low)
        value = loop_at(middle).imag
        before = (value < 0) != (at_high < 0)
        low, at_low = np.where(before, middle, low), np.where(before, value, at_low)
        high, at_high = np.where(before, high, middle), np.where(before, at_high, value)
    return np.asarray(np.where(np.abs(at_low) < np.abs(at_high), low, high))


FIRST_BLOCK_STEPS = 64
"""Grid steps searched first; every further block is twice as long."""
MAX_BLOCK_VALUES = 2_000_000
"""Most grid values (speeds times steps) of a block: it bounds the memory."""
MAX_LOOP_REFINEMENT_STEPS = 60
"""Most steps of the search for a crossing inside one grid step; a handful is usual."""
TURN_TOLERANCE = 1e-11
"""Turns that no longer count."""
MIN_MEAN_FORCE_IMMERSION = 0.25
"""Least immersion for which a mean force describes a cut."""
MAX_FLIP_IMMERSION = 0.95
"""Largest immersion with flip lobes at fast teeth, around tooth frequency = 2 f_n / (2 k + 1)."""
MIN_FAST_TOOTH_RATIO = 0.5
"""Tooth frequency over chatter frequency from which the wide flip lobes, k = 0 and 1, occur."""
MEAN_FORCE_REMEDY = "Compute the limit with semi-discretisation"
"""Remedy if a mean force does not describe the cut."""


def loop_limits(branches: Sequence[TipResponse], cut: Cut, speed_rpm: Floats, method: MethodName) -> StabilityLobes:
    """Return the limiting depth b at each speed (rpm) of loops b L (1 - exp(-2 pi i f_c / f_t)) = -1.

    The branches give L over frequency (1/m); the lowest limit of all branches counts: b = -1 / (2 Re L) for Re L < 0,
    and f_c / f_t = j + eps / (2 pi), j = 0, 1, 2 ..., eps / 2 = atan2(-Re L, Im L). For uneven teeth see
    `uneven_limits`; they have limits and no lobes.
    """
    tooth_frequency = cut.teeth * speed_rpm / 60
    depth, chatter = np.full(speed_rpm.shape, np.inf), np.full(speed_rpm.shape, np.nan)
    setting = np.zeros(speed_rpm.shape, dtype=np.intp)
    responses = [branch.on_grid for branch in branches]
    for i, branch in enumerate(branches):
        if cut.pitch:
            limit, frequency = uneven_limits(branch, cut, tooth_frequency)
        else:
            limit, frequency = _branch_limits(branch, responses[i], tooth_frequency)
        lower = limit < depth
        depth[lower], chatter[lower], setting[lower] = limit[lower], frequency[lower], i
    limited = np.isfinite(depth)
    waves = np.where(limited, np.floor(np.where(limited, chatter, 0) / tooth_frequency), -1).astype(np.int64)
    parts = [(branch.grid, response) for branch, response in zip(branches, responses, strict=True)]
    loops = [(*part, np.unique(waves[limited & (setting == i)])) for i, part in enumerate(parts) if not cut.pitch]
    grid, weakest = min(parts, key=lambda part: float(np.min(part[1].real)))
    lowest = float(grid[np.argmin(weakest.real)])
    return StabilityLobes(
        speed_rpm=speed_rpm,
        depth=depth,
        chatter_frequency=chatter,
        kind=np.where(limited, "hopf", ""),
        crossings=depth[:, np.newaxis],
        method=method,
        curves=partial(_lobes_of_loops, loops, cut, speed_rpm),
        remarks=_band_remarks(grid, weakest.real) or _mean_force_remarks(cut, lowest, speed_rpm),
    )


def _band_remarks(grid: Floats, real: Floats) -> tuple[Remark, ...]:
    """Return a remark if the measured lines end before the weakest point of the loop."""
    weakest = int(np.argmin(real))
    if grid[0] == 0 or (real[weakest] < 0 and 0 < weakest < grid.size - 1):
        return ()
    text = f"the FRF does not cover the chatter band: no minimum of the real part in {grid[0]:g} to {grid[-1]:g} Hz"
    return (Remark("chatter-band-missing", "", text, "Use or record an FRF over a wider band"),)


def _mean_force_remarks(cut: Cut, chatter: float, speed_rpm: Floats) -> tuple[Remark, ...]:
    """Return a remark if the immersion is too low, or the teeth are too fast, for a mean force."""
    if cut.immersion < MIN_MEAN_FORCE_IMMERSION:
        text = f"immersion {cut.immersion:g} is below {MIN_MEAN_FORCE_IMMERSION}"
        text = f"depth limit may be too high: {text}, and flip lobes are not included"
        return (Remark("low-immersion", "", text, MEAN_FORCE_REMEDY),)
    fast = MIN_FAST_TOOTH_RATIO * 60 * chatter / cut.teeth
    if cut.immersion >= MAX_FLIP_IMMERSION or np.max(speed_rpm) < fast:
        return ()
    text = (
        f"depth limit may be much too high above {fast:.0f} rpm: flip lobes not included (immersion {cut.immersion:g})"
    )
    return (Remark("fast-teeth", "", text, MEAN_FORCE_REMEDY),)


def _branch_limits(branch: TipResponse, response: Complexes, tooth_frequency: Floats) -> tuple[Floats, Floats]:
    """Return depth (m) and frequency (Hz) of the lowest crossing at each tooth frequency (Hz); inf and nan if none."""
    chatter = _lowest_crossing_frequency(branch, response, tooth_frequency)
    limited = np.flatnonzero(np.isfinite(chatter))
    real = branch.receptance(chatter[limited]).real
    chatter[limited[real >= 0]] = np.nan
    depth = np.full(chatter.shape, np.inf)
    depth[limited[real < 0]] = -1 / (2 * real[real < 0])
    return depth, chatter


def _lowest_crossing_frequency(branch: TipResponse, response: Complexes, tooth_frequency: Floats) -> Floats:
    """Return the frequency of the lowest crossing at each tooth frequency (Hz), shape (n,); nan if there is none.

    f/f_t - arg(L)/pi + 1/2 is a whole number at every crossing, with arg(L) continuous along f. The steps
    of the grid are searched in the order of their limits, until each tooth frequency has one below all that is left.
    """
    turn = 0.5 - np.unwrap(np.angle(response)) / np.pi
    lowest = np.minimum(response.real[1:], response.real[:-1])
    order = np.flatnonzero(lowest < 0)
    order = order[np.argsort(lowest[order])]
    best, step, whole = np.zeros(tooth_frequency.shape), np.zeros(tooth_frequency.shape, np.intp), 0 * tooth_frequency
    begin, size = 0, FIRST_BLOCK_STEPS
    while begin < order.size:
        rows = np.flatnonzero(best > lowest[order[begin]])
        if not rows.size:
            break
        block = order[begin : begin + max(1, min(size, MAX_BLOCK_VALUES // rows.size))]
        row, real, where, number = _lowest_step(branch.grid, turn, response.real, block, tooth_frequency[rows])
        lower = real < best[rows[row]]
        at = rows[row[lower]]
        best[at], step[at], whole[at] = real[lower], where[lower], number[lower]
        begin, size = begin + block.size, 2 * size
    chatter = np.full(tooth_frequency.shape, np.nan)
    negative = np.flatnonzero(best < 0)
    missing = whole[negative] - branch.grid[step[negative]] / tooth_frequency[negative] - turn[step[negative]]
    chatter[negative] = _refine_crossing(branch, step[negative], missing, tooth_frequency[negative])
    return chatter


def _lowest_step(
    grid: Floats, turn: Floats, real: Floats, block: Indices, tooth_frequency: Floats
) -> tuple[Indices, Floats, Indices, Floats]:
    """Return index, real part, grid step and whole number of the lowest crossing in a block for tooth frequencies.

    If several whole numbers lie in one step, the one nearest its end of lower real part is the lowest limit. Tooth
    frequencies without a crossing are left out.
    """
    lower = block + (real[block + 1] < real[block])
    upper = 2 * block + 1 - lower
    period = 1 / tooth_frequency[:, np.newaxis]
    at_lower, at_upper = grid[lower] * period + turn[lower], grid[upper] * period + turn[upper]
    floor = np.floor(at_lower)
    crosses = floor != np.floor(at_upper)
    row, column = np.divmod(np.flatnonzero(crosses), block.size)
    start, end = at_lower[row, column], at_upper[row, column]
    number = floor[row, column] + (end > start)
    share = (number - start) / (end - start)
    at_crossing = real[lower[column]] + share * (real[upper[column]] - real[lower[column]])
    order = np.lexsort((at_crossing, row))
    first = order[np.flatnonzero(np.diff(row[order], prepend=-1))]
    return row[first], at_crossing[first], block[column[first]], number[first]


def _refine_crossing(branch: TipResponse, step: Indices, missing: Floats, tooth_frequency: Floats) -> Floats:
    """Return the frequency (Hz) inside each grid step at which `missing` turns from its lower end are complete.

    By the false position; the weight of an end that stays twice is halved (Illinois).
    """
    start, low, high = branch.grid[step], branch.grid[step], branch.grid[step + 1]
    origin = branch.receptance(start)

    def excess(frequency: Floats) -> Floats:
        turned = np.angle(branch.receptance(frequency) * np.conj(origin)) / np.pi
        return np.asarray((frequency - start) / tooth_frequency - turned - missing)

    at_low, at_high = -missing, excess(high)
    middle, was_before = low, np.full(step.shape, -1)
    for _ in range(MAX_LOOP_REFINEMENT_STEPS):
        middle = np.clip(high - at_high * (high - low) / (at_high - at_low), low, high)
        value = excess(middle)
        if np.all(np.abs(value) < TURN_TOLERANCE):
            break
        before = value * at_high < 0
        weight = np.where(before == was_before, 0.5, 1.0)
        low, high = np.where(before, middle, low), np.where(before, high, middle)
        at_low, at_high = np.where(before, value, weight * at_low), np.where(before, weight * at_high, value)
        was_before = before
    return middle


def _lobes_of_loops(loops: Sequence[tuple[Floats, Complexes, Integers]], cut: Cut, speed_rpm: Floats) -> list[Lobe]:
    return [lobe for loop in loops for lobe in _lobes_of_loop(*loop, cut, speed_rpm)]


def _lobes_of_loop(grid: Floats, response: Complexes, numbers: Integers, cut: Cut, speed_rpm: Floats) -> Iterator[Lobe]:
    index = np.flatnonzero(response.real < 0)
    frequency, response = grid[index], response[index]
    depth = -1 / (2 * response.real)
    fraction = np.arctan2(-response.real, response.imag) / np.pi
    unbroken = np.diff(index) == 1
    for number in numbers:
        speed = 60 / cut.teeth * frequency / (number + fraction)
        slow, fast = speed <= np.max(speed_rpm), speed >= np.min(speed_rpm)
        reaching = np.flatnonzero((slow[1:] | slow[:-1]) & (fast[1:] | fast[:-1]) & unbroken)
        for run in np.split(reaching, np.flatnonzero(np.diff(reaching) > 1) + 1):
            if run.size:
                piece = slice(run[0], run[-1] + 2)
                yield Lobe(int(number), speed[piece], depth[piece], frequency[piece])
