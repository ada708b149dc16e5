"""Stability lobes by the average tooth angle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.cut import Cut
from lobes.speeds import check_speeds
from lobes.stability_lobes import Lobe, StabilityLobes
from lobes.tip_response import Tip, TipResponse, tip_response, weighted_sum

BLOCK = 2_000_000
"""Grid values (speeds times frequencies) searched at once: it bounds the memory."""
HALVINGS = 52
"""Bisections of one grid step: down to rounding."""

Floats = NDArray[np.float64]


def average_angle(x: Tip | None, y: Tip | None, cut: Cut, speed_rpm: ArrayLike) -> StabilityLobes:
    """Limiting depth at each speed (rpm) for the tooth frozen at its average angle.

    x is the feed, y the normal to it; None stands for a direction that is rigid or not known. With
    G_or = mu_x Gx + mu_y Gy (`Cut.orientation_factors`) the cut is at its limit where chatter at frequency f_c > 0
    sustains itself,

        Ks Nt* b G_or (1 - exp(-2 pi i f_c / f_t)) = -1,     tooth frequency f_t = N speed / 60:

    b = -1 / (2 Ks Nt* Re G_or) where Re G_or < 0, and f_c / f_t = j + eps / (2 pi), j = 0, 1, 2 ...,
    eps / 2 = atan2(-Re G_or, Im G_or). The limit is the lowest b over all lobes j; `crossings` holds it alone.
    A mean force knows no flip lobes: at low immersion (below 0.25) the true limit can be lower.

    From FRFs only chatter inside their common usable band is seen: cut them with `Frf.in_band` to what is to be
    trusted; x and y may have different lines (see `lobes.tip_response`). A depth of inf means no chatter there.

    Raises ValueError for speeds not > 0, two rigid directions, an empty list of modes, modes of negative stiffness,
    and FRFs without a common band.
    Source: Tlusty; Schmitz & Smith, Machining Dynamics, ch. 4.
    """
    speed = check_speeds(speed_rpm)
    tooth_frequency = cut.teeth * speed / 60
    tip = _oriented(x, y, cut, float(np.max(tooth_frequency)))
    chatter = _chatter_frequency(tip, tooth_frequency)
    found = np.isfinite(chatter)
    depth = np.full(speed.shape, np.inf)
    depth[found] = _depth(tip.receptance(chatter[found]), cut)
    numbers = np.unique(np.floor(chatter[found] / tooth_frequency[found]).astype(np.int64))
    return StabilityLobes(
        speed_rpm=speed,
        depth=depth,
        chatter_frequency=chatter,
        kind=np.where(found, "hopf", ""),
        crossings=depth[:, np.newaxis],
        method="average tooth angle",
        lobes=tuple(_lobes(tip, cut, numbers, speed)),
    )


def _oriented(x: Tip | None, y: Tip | None, cut: Cut, tooth_frequency: float) -> TipResponse:
    factors = zip(("x", "y"), (x, y), cut.orientation_factors, strict=True)
    parts = [(mu, tip_response(tip, name, tooth_frequency)) for name, tip, mu in factors if tip is not None]
    if not parts:
        raise ValueError("x and y are both None; give the modes or the FRF of one direction at least")
    return weighted_sum(parts)


def _depth(receptance: NDArray[np.complex128], cut: Cut) -> Floats:
    """Limiting depth (m) where chatter meets this oriented receptance, whose real part is negative."""
    return -1 / (2 * cut.specific_force * cut.teeth_in_cut * receptance.real)


def _chatter_frequency(tip: TipResponse, tooth_frequency: Floats) -> Floats:
    """Frequency of the lowest crossing at each tooth frequency (Hz), shape (n,); nan where there is none.

    f/f_t - arg(G)/pi + 1/2 is a whole number at every crossing, with arg(G) followed continuously along f.
    One pass over it finds the crossings of all lobes, however many there are and whichever way they run.
    """
    response = tip.receptance(tip.grid)
    turn = 0.5 - np.unwrap(np.angle(response)) / np.pi
    chatter = np.full(tooth_frequency.shape, np.nan)
    n_blocks = 1 + tooth_frequency.size * tip.grid.size // BLOCK
    for block in np.array_split(np.arange(tooth_frequency.size), n_blocks):
        turns = tip.grid / tooth_frequency[block, np.newaxis] + turn
        row, step, whole = _lowest_step(turns, response.real)
        chatter[block[row]] = _refine(tip, step, whole - turns[row, step], tooth_frequency[block[row]])
    found = np.flatnonzero(np.isfinite(chatter))
    chatter[found[tip.receptance(chatter[found]).real >= 0]] = np.nan
    return chatter


def _lowest_step(turns: Floats, real: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """For each row of turns (n, p) with a crossing: the row, the grid step of its lowest one, and its whole number.

    Where several whole numbers lie in one step, the one nearest its end of lower real part is the lowest limit.
    """
    floor = np.floor(turns)
    row, step = np.nonzero((floor[:, 1:] != floor[:, :-1]) & (np.minimum(real[1:], real[:-1]) < 0))
    lower = step + (real[step + 1] < real[step])
    upper = 2 * step + 1 - lower
    whole = floor[row, lower] + (turns[row, upper] > turns[row, lower])
    share = (whole - turns[row, lower]) / (turns[row, upper] - turns[row, lower])
    at_crossing = real[lower] + share * (real[upper] - real[lower])
    order = np.lexsort((at_crossing, row))
    first = order[np.flatnonzero(np.diff(row[order], prepend=-1))]
    return row[first], step[first], whole[first]


def _refine(tip: TipResponse, step: NDArray[np.intp], missing: Floats, tooth_frequency: Floats) -> Floats:
    """Frequency (Hz) inside each grid step at which `missing` turns, counted from its lower end, have been made."""
    start, low, high = tip.grid[step], tip.grid[step], tip.grid[step + 1]
    origin = tip.receptance(start)

    def excess(frequency: Floats) -> Floats:
        turned = np.angle(tip.receptance(frequency) * np.conj(origin)) / np.pi
        return np.asarray((frequency - start) / tooth_frequency - turned - missing)

    rising = np.sign(excess(high))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        before = excess(middle) * rising < 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return (low + high) / 2


def _lobes(tip: TipResponse, cut: Cut, numbers: NDArray[np.int64], speed_rpm: Floats) -> Iterator[Lobe]:
    lowest, highest = np.min(speed_rpm), np.max(speed_rpm)
    response = tip.receptance(tip.grid)
    index = np.flatnonzero(response.real < 0)
    frequency, response = tip.grid[index], response[index]
    depth = _depth(response, cut)
    fraction = np.arctan2(-response.real, response.imag) / np.pi
    for number in numbers:
        speed = 60 * frequency / (cut.teeth * (number + fraction))
        reaching = (np.minimum(speed[1:], speed[:-1]) <= highest) & (np.maximum(speed[1:], speed[:-1]) >= lowest)
        steps = np.flatnonzero(reaching & (np.diff(index) == 1))
        for run in np.split(steps, np.flatnonzero(np.diff(steps) > 1) + 1):
            if run.size:
                piece = slice(run[0], run[-1] + 2)
                yield Lobe(int(number), speed[piece], depth[piece], frequency[piece])
