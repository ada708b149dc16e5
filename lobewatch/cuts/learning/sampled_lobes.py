"""Stability lobes of a tool that nobody tapped: Monte Carlo samples of its modes and of the cut.

Unknown values are drawn: stiffness, damping, modes that have not chattered yet, radial depth,
direction and Kr. Lobes are those of the zero-order approximation. Each sample counts by how well it explains the cuts.
Sources: Altintas & Budak, CIRP Annals 44 (1995) 357-362; Karandikar, Traverso, Abbas & Schmitz, 2014.
"""

import itertools
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np

from lobes import Cut, Direction
from lobes.tooth_force import mean_force
from lobewatch.arrays import Complexes, Floats, Indices

N_SAMPLES, SEED = 400, 0
"""Number of samples, chosen, and the seed that makes them the same each time."""
HEARD_FREQUENCY_STD = 0.04
"""Relative standard deviation of a natural frequency around its first estimate; chosen."""
MAX_UNHEARD, UNHEARD_PROBABILITY = 2, 0.4
"""Number of modes that have not chattered, at most, and the probability of each; chosen."""
UNHEARD_FREQUENCY, UNHEARD_STIFFNESS = (0.4, 2.5), (1.0, 6.0)
"""Range of their frequency and stiffness over those of the first mode; chosen."""
RIGID = 1e6
"""Stiffness over that of the first mode of a mode that is not there; chosen."""
HEARD_STIFFNESS = 2.7
"""Largest ratio of the stiffness of two heard modes; chosen."""
DAMPING_RATIOS = (0.01, 0.05)
"""Range of damping ratios of tool tips; chosen."""
AXES_FREQUENCY, AXES_OTHER = 1.1, 1.42
"""Largest ratio of the frequency, and of damping ratio or stiffness, of a mode in x and in y; chosen."""
IMMERSIONS = (0.1, 0.3, 0.6, 1.0)
"""Radial depths over diameter; chosen."""
RADIAL_FORCES = (0.1, 0.5)
"""Range of Kr over Kt; chosen."""
N_FREQUENCIES, LAST_PHASE = 17, 1.5
"""Number of frequencies around each resonance, and the largest angle (rad), whose tangent is their distance.

The distance is in half bandwidths."""
LOWEST_FREQUENCY = 0.2
"""Lowest frequency over that of the slowest mode; chosen."""
MAX_LOBE_GAIN = 20.0
"""Largest limit over the lowest one that counts; chosen."""
MAX_WAVES = 100
"""Waves between two teeth above which all speeds have the lowest limit; pockets there are at most 20 % deeper."""


_Points: TypeAlias = tuple[Indices, Floats, Floats]
"""Flat places in (samples, speeds), depths in any unit and chatter frequencies (Hz)."""


class SampledModes(NamedTuple):
    """Modes of each sample in one direction, shape (samples, modes) each."""

    frequency: Floats
    """Natural frequency (Hz)."""
    damping_ratio: Floats
    """Damping ratio."""
    stiffness: Floats
    """Stiffness over that of the first mode."""

    def near_resonances(self) -> Floats:
        """Return frequencies around each resonance (Hz), shape (samples, n), dense where the phase turns."""
        bandwidths = np.tan(np.linspace(-LAST_PHASE, LAST_PHASE, N_FREQUENCIES))
        found = self.frequency[..., np.newaxis] * (1 + self.damping_ratio[..., np.newaxis] * bandwidths)
        return np.asarray(found.reshape(len(found), -1))

    def receptance(self, frequency: Floats) -> Complexes:
        """Return the receptance of each sample at its frequencies, shape (samples, n)."""
        total = np.zeros(frequency.shape, dtype=np.complex128)
        for f, zeta, k in zip(self.frequency.T, self.damping_ratio.T, self.stiffness.T, strict=True):
            ratio = frequency / f[:, np.newaxis]
            total += 1 / (k[:, np.newaxis] * (1 - ratio**2 + 2j * zeta[:, np.newaxis] * ratio))
        return total


class SampledLobes(NamedTuple):
    """Lobes of each sample, shape (samples, speeds) each."""

    limits: Floats
    """Largest stable depth over the lowest one in the range."""
    frequencies: Floats
    """Chatter frequency at the limit (Hz); NaN if unknown."""


def sample_lobes(modes: Sequence[float], teeth: int, speeds: Floats) -> SampledLobes:
    """Draw the lobes of a tool by the natural frequencies that were heard.

    Parameters
    ----------
    modes
        Natural frequencies (Hz) that chatter frequencies stand for, at least one.
    teeth
        Number of teeth.
    speeds
        Rising spindle speeds (rpm) with a constant ratio, shape (n,).

    Examples
    --------
    The best speed is near that of the classic rule, 60 f / (N k), in most samples:

    >>> speeds = np.geomspace(8000.0, 15000.0, 100)
    >>> lobes = sample_lobes([1000.0], 3, speeds)
    >>> round(float(np.median(speeds[np.argmax(lobes.limits, axis=1)])), -3)  # 60 x 1000 / (3 x 2) = 10 000 rpm
    10000.0
    """
    draw = np.random.default_rng(SEED)
    x = _draw_heard_and_unheard(draw, modes)
    y = _vary(draw, x)
    frequency = np.concatenate([x.near_resonances(), y.near_resonances()], axis=1)
    frequency = np.maximum(np.sort(frequency), LOWEST_FREQUENCY * np.min(x.frequency, axis=1, keepdims=True))
    eigenvalues = _loop_eigenvalues(_draw_forces(draw), x.receptance(frequency), y.receptance(frequency))
    return _lowest_limits(frequency, eigenvalues, teeth, speeds)


def _draw_heard_and_unheard(draw: np.random.Generator, modes: Sequence[float]) -> SampledModes:
    """Draw the modes in x: those that were heard, and up to two more."""
    count = len(modes)
    heard = np.array(modes) * np.exp(HEARD_FREQUENCY_STD * draw.normal(size=(N_SAMPLES, count)))
    stiffness = _log_uniform(draw, 1 / HEARD_STIFFNESS, HEARD_STIFFNESS, count)
    stiffness[:, 0] = 1
    more = modes[0] * _log_uniform(draw, *UNHEARD_FREQUENCY, MAX_UNHEARD)
    more_stiffness = _log_uniform(draw, *UNHEARD_STIFFNESS, MAX_UNHEARD)
    more_stiffness[draw.uniform(size=more.shape) > UNHEARD_PROBABILITY] = RIGID
    damping = draw.uniform(*DAMPING_RATIOS, (N_SAMPLES, count + MAX_UNHEARD))
    return SampledModes(np.hstack([heard, more]), damping, np.hstack([stiffness, more_stiffness]))


def _vary(draw: np.random.Generator, modes: SampledModes) -> SampledModes:
    """Draw the modes in y, which resemble those in x."""
    ratios = (AXES_FREQUENCY, AXES_OTHER, AXES_OTHER)
    count = modes.frequency.shape[1]
    return SampledModes(*(x * _log_uniform(draw, 1 / r, r, count) for x, r in zip(modes, ratios, strict=True)))


def _log_uniform(draw: np.random.Generator, low: float, high: float, count: int) -> Floats:
    return np.exp(draw.uniform(np.log(low), np.log(high), (N_SAMPLES, count)))


@cache
def _forces_of_cuts() -> Floats:
    """Return the mean force matrix of each kind of cut at the lowest and highest Kr, shape (kinds, 2, 2, 2)."""
    directions: tuple[Direction, ...] = ("up", "down")
    kinds = itertools.product(IMMERSIONS, directions)
    return np.array([[mean_force(Cut(1, *kind, 1.0, radial)) for radial in RADIAL_FORCES] for kind in kinds])


def _draw_forces(draw: np.random.Generator) -> Floats:
    """Draw a mean force matrix for each sample, shape (samples, 2, 2)."""
    table = _forces_of_cuts()
    kind, share = draw.integers(0, len(table), N_SAMPLES), draw.uniform(size=(N_SAMPLES, 1, 1))
    return np.asarray((1 - share) * table[kind, 0] + share * table[kind, 1])


def _loop_eigenvalues(force: Floats, x: Complexes, y: Complexes) -> tuple[Complexes, Complexes]:
    """Return both eigenvalues of force times response, shape (samples, n) each."""
    xx, xy, yx, yy = (force[:, i, j, np.newaxis] for i in range(2) for j in range(2))
    half = (xx * x + yy * y) / 2
    root = np.sqrt(half**2 - (xx * yy - xy * yx) * x * y)
    return half + root, half - root


def _lowest_limits(frequency: Floats, loops: Sequence[Complexes], teeth: int, speeds: Floats) -> SampledLobes:
    """Return the lowest limit of all lobes at each speed, and its frequency, by rising frequencies."""
    limits, chatter = np.full((len(frequency), speeds.size), np.inf), np.full((len(frequency), speeds.size), np.nan)
    points = [point for loop in loops for point in _lobe_points(frequency, loop, teeth, speeds)]
    for place, depth, _ in points:
        np.minimum.at(limits.reshape(-1), place, depth)
    for place, depth, hz in points:
        is_lowest = depth <= limits.reshape(-1)[place]
        chatter.reshape(-1)[place[is_lowest]] = hz[is_lowest]
    lowest = np.min(limits, axis=1, keepdims=True)
    lowest[np.isinf(lowest)] = 1.0  # no lobe in the range: deep cuts are stable at all speeds
    return SampledLobes(np.minimum(limits / lowest, MAX_LOBE_GAIN), chatter)


def _lobe_points(frequency: Floats, loop: Complexes, teeth: int, speeds: Floats) -> Iterator[_Points]:
    """Yield each lobe up to `MAX_WAVES` at all speeds between its frequencies, and the lowest limits above."""
    is_lobe = loop.real < 0
    depth = -1 / (2 * np.where(is_lobe, loop.real, -np.inf))
    step = np.log(speeds[1] / speeds[0])
    place = np.log(60 * frequency / teeth / speeds[0]) / step  # with one wave
    last = np.minimum(np.floor(place - np.log(MAX_WAVES) / step), speeds.size - 1).astype(np.intp)
    slow = np.nonzero(is_lobe & (last >= 0))
    yield _spread_lowest(slow[0], last[slow], depth[slow], frequency[slow], speeds.size)
    sample, point = np.nonzero(is_lobe[:, 1:] & is_lobe[:, :-1])
    part = np.mod(np.angle(loop) / np.pi - 0.5, 1)
    places, parts, depths, hz = (
        np.stack([x[sample, point], x[sample, point + 1]]) for x in (place, part, depth, frequency)
    )
    waves = parts + np.maximum(np.floor(np.exp(step * (np.min(places, axis=0) - speeds.size)) - 1), 0)
    while sample.size:
        ends = places - np.log(np.maximum(waves, np.finfo(np.float64).tiny)) / step
        yield _interpolate(sample, ends, depths, hz, speeds.size)
        goes_on = (np.max(ends, axis=0) >= 0) & (waves[0] < MAX_WAVES)
        sample, places, waves, depths, hz = (x[..., goes_on] for x in (sample, places, waves + 1, depths, hz))


def _interpolate(sample: Indices, ends: Floats, depths: Floats, hz: Floats, n_speeds: int) -> _Points:
    """Interpolate depth and frequency at each speed between two neighbouring points of a lobe, shape (2, n) each."""
    first = np.maximum(np.ceil(np.min(ends, axis=0)), 0)
    last = np.minimum(np.floor(np.max(ends, axis=0)), n_speeds - 1)
    count = np.maximum(last - first + 1, 0).astype(np.intp)
    pair = np.repeat(np.arange(count.size), count)
    speed = first[pair] + np.arange(pair.size) - np.repeat(np.cumsum(count) - count, count)
    start, end = ends[:, pair]
    share = (speed - start) / np.where(end == start, 1, end - start)
    depth, frequency = (x[0, pair] + share * (x[1, pair] - x[0, pair]) for x in (depths, hz))
    return sample[pair] * n_speeds + speed.astype(np.intp), depth, frequency


def _spread_lowest(sample: Indices, last: Indices, depth: Floats, hz: Floats, n_speeds: int) -> _Points:
    """Return the lowest of points that each cover all speeds up to a last one."""
    order = np.argsort(-depth)
    lowest = np.full((N_SAMPLES, n_speeds), -1)
    lowest[sample[order], last[order]] = np.arange(order.size)  # of equal places, the last one counts: the lowest
    spread = np.maximum.accumulate(lowest[:, ::-1], axis=1)[:, ::-1].reshape(-1)
    place = np.flatnonzero(spread >= 0)
    return place, depth[order][spread[place]], hz[order][spread[place]]
