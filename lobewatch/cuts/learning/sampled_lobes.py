"""Stability lobes of a tool that nobody tapped: Monte Carlo samples of its modes and of the cut.

Unknown values are drawn: stiffness, damping, a mode that has not chattered yet, radial depth,
direction and Kr. Lobes are those of the zero-order approximation. Each sample counts by how well it explains the cuts.
Sources: Altintas & Budak, CIRP Annals 44 (1995) 357-362; Karandikar, Traverso, Abbas & Schmitz, 2014.
"""

import itertools
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.ndimage import minimum_filter1d

from lobes import Cut, Direction
from lobes.tooth_force import mean_force
from lobewatch.arrays import Complexes, Floats, Indices

N_SAMPLES, SEED = 600, 0
"""Number of samples, chosen, and the seed that makes them the same each time."""
HEARD_FREQUENCY_STD = 0.025
"""Relative standard deviation of a natural frequency around its first estimate; chosen."""
UNHEARD_PROBABILITY, UNHEARD_FREQUENCY, UNHEARD_STIFFNESS = 0.4, (0.4, 2.5), (1.0, 6.0)
"""Probability of one more mode, its frequency and stiffness over those of the first; chosen."""
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
N_FREQUENCIES, LAST_PHASE = 161, 1.55
"""Number of frequencies around each resonance, and the largest angle (rad), whose tangent is their distance.

The distance is in half bandwidths."""
LOWEST_FREQUENCY = 0.2
"""Lowest frequency over that of the slowest mode; chosen."""
MAX_GAIN = 1e3
"""Largest limit over the lowest one that counts; chosen."""
MAX_WAVES = 60
"""Waves between two teeth above which all speeds have the lowest limit; pockets there are at most 20 % deeper."""
GAP_SPEEDS = 13
"""Number of speeds around one that no sampled frequency reaches, of which the lowest limit counts; chosen."""


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
    frequency = np.maximum(frequency, LOWEST_FREQUENCY * np.min(x.frequency, axis=1, keepdims=True))
    eigenvalues = _loop_eigenvalues(_draw_forces(draw), x.receptance(frequency), y.receptance(frequency))
    return _lowest_limits(frequency, eigenvalues, teeth, speeds)


def _draw_heard_and_unheard(draw: np.random.Generator, modes: Sequence[float]) -> SampledModes:
    """Draw the modes in x: those that were heard, and with some probability one more."""
    count = len(modes)
    heard = np.array(modes) * np.exp(HEARD_FREQUENCY_STD * draw.normal(size=(N_SAMPLES, count)))
    stiffness = _log_uniform(draw, 1 / HEARD_STIFFNESS, HEARD_STIFFNESS, count)
    stiffness[:, 0] = 1
    more = modes[0] * _log_uniform(draw, *UNHEARD_FREQUENCY, 1)
    its_stiffness = _log_uniform(draw, *UNHEARD_STIFFNESS, 1)
    its_stiffness[draw.uniform(size=N_SAMPLES) > UNHEARD_PROBABILITY] = RIGID
    damping = draw.uniform(*DAMPING_RATIOS, (N_SAMPLES, count + 1))
    return SampledModes(np.hstack([heard, more]), damping, np.hstack([stiffness, its_stiffness]))


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
    """Return the lowest limit of all lobes at each speed, and its frequency."""
    limits, chatter = np.full((len(frequency), speeds.size), np.inf), np.full((len(frequency), speeds.size), np.nan)
    points = [point for loop in loops for point in _lobe_points(frequency, loop, teeth, speeds)]
    for place, depth, _ in points:
        np.minimum.at(limits.reshape(-1), place, depth)
    for place, depth, hz in points:
        is_lowest = depth <= limits.reshape(-1)[place]
        chatter.reshape(-1)[place[is_lowest]] = hz[is_lowest]
    limits = np.where(np.isinf(limits), minimum_filter1d(limits, GAP_SPEEDS, axis=1), limits)
    lowest = np.min(limits, axis=1, keepdims=True)
    lowest[np.isinf(lowest)] = 1.0  # no lobe in the range: deep cuts are stable at all speeds
    return SampledLobes(np.minimum(limits / lowest, MAX_GAIN), chatter)


def _lobe_points(frequency: Floats, loop: Complexes, teeth: int, speeds: Floats) -> Iterator[_Points]:
    """Yield each lobe up to `MAX_WAVES`, and the lowest limits above."""
    sample, point = np.nonzero(loop.real < 0)
    response, hz = loop[sample, point], frequency[sample, point]
    depth, part = -1 / (2 * response.real), np.mod(np.angle(response) / np.pi - 0.5, 1)
    step = np.log(speeds[1] / speeds[0])
    first = np.maximum(np.ceil(60 * hz / (teeth * speeds[-1]) * np.exp(-step / 2) - part), 0)
    place, waves = np.log(60 * hz / teeth / speeds[0]) / step, part + first
    last = np.minimum(np.floor(place - np.log(MAX_WAVES) / step), speeds.size - 1)
    slow = np.flatnonzero(last >= 0)
    yield _spread_lowest(sample[slow], last[slow].astype(np.intp), depth[slow], hz[slow], speeds.size)
    while depth.size:
        at = np.rint(place - np.log(np.maximum(waves, np.finfo(np.float64).tiny)) / step)
        inside = (at >= 0) & (at < speeds.size)
        yield sample[inside] * speeds.size + at[inside].astype(np.intp), depth[inside], hz[inside]
        goes_on = (at >= 0) & (waves < MAX_WAVES)
        sample, hz, depth, place, waves = (values[goes_on] for values in (sample, hz, depth, place, waves + 1))


def _spread_lowest(sample: Indices, last: Indices, depth: Floats, hz: Floats, n_speeds: int) -> _Points:
    """Return the lowest of points that each cover all speeds up to a last one."""
    order = np.argsort(-depth)
    lowest = np.full((N_SAMPLES, n_speeds), -1)
    lowest[sample[order], last[order]] = np.arange(order.size)  # of equal places, the last one counts: the lowest
    spread = np.maximum.accumulate(lowest[:, ::-1], axis=1)[:, ::-1].reshape(-1)
    place = np.flatnonzero(spread >= 0)
    return place, depth[order][spread[place]], hz[order][spread[place]]
