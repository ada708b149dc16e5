"""Next speed and depth to try by the sound of cuts only, without a tap test.

Each chatter frequency stands for a mode a little below it. Samples of these modes and of the cut (`sampled_lobes`) are
weighted by the verdicts and the chatter frequencies so far. The best speed is near the classic rule, tooth passing at
f_c / k. Source: Altintas & Budak, CIRP Annals 44 (1995) 357-362; Schmitz & Smith, Machining Dynamics, ch. 4.
How often it succeeds: docs/studies/cuts.md.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lobewatch.arrays import Flags, Floats
from lobewatch.cuts.learning.pocket_depth import PROGRAM_SPEED_TOLERANCE
from lobewatch.cuts.learning.sampled_lobes import MAX_LOBE_GAIN, SampledLobes, sample_lobes
from lobewatch.machine.journal.entries import CutVerdict
from lobewatch.machine.settings.drive_power import SPEED_STEP_RPM, round_down_depth_mm

SAME_MODE_TOLERANCE, SIDEBAND_TOLERANCE = 0.15, 0.02
"""Logarithmic distances within which a chatter frequency, or a side band of it, belongs to a known mode; chosen."""
CHATTER_OVER_NATURAL = 1.015
"""Mean chatter frequency over natural frequency; chosen on simulated cuts (docs/studies/cuts.md)."""
CLASSIC_TOLERANCE = 0.025
"""Relative distance of the first suggested speed below that of the classic rule; chosen."""
MAX_MODES = 4
"""Largest number of modes in a search; chosen."""
LIMIT_UNCERTAINTY, FREQUENCY_UNCERTAINTY = 0.15, 0.03
"""Logarithmic uncertainty of a stability limit and of a chatter frequency; chosen."""
UNEXPLAINED, SIDEBAND_LIKELIHOOD = 0.1, 0.15
"""Likelihood of a chatter frequency of another cause, and of a side band, over that of the best one; chosen."""
SPEED_STEP = 0.005
"""Relative step of the searched speeds; chosen."""
SPEED_UNCERTAINTY = 0.01
"""Relative standard deviation of the pocket speeds, over which chances are averaged; chosen."""
TRIED_TOLERANCE = 0.02
"""Relative distance in speed within which chatter at the newest depth, or a smaller one, excludes a speed; chosen."""
N_SPEEDS = 3
"""Largest number of suggested speeds; chosen."""
WINDOW_SHARE = 0.8
"""Smallest limit in the window of a pocket over that at its speed; chosen."""
MAX_CUTS_AT_DEPTH = 3
"""Number of chattering cuts at a depth after which no speed is deep enough; chosen."""
MIN_CUTS_BEFORE_LESS = 2
"""Number of chattering cuts after which each next one is less deep; chosen."""
NEXT_DEPTH_FACTOR = 0.7
"""Next depth over one that chattered; chosen."""


class HeardCut(NamedTuple):
    """Cut as it was heard."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    verdict: CutVerdict
    """Verdict on the cut."""
    frequency: float = math.nan
    """Chatter frequency (Hz); NaN if unknown or stable."""
    depth: float = math.nan
    """Axial depth of cut (m); NaN if unknown, as for all cuts."""

    @property
    def has_chatter(self) -> bool:
        """True if the cut was not stable."""
        return self.verdict in ("chatter", "flip")

    def contradicts(self, other: "HeardCut") -> bool:
        """Return whether one of two cuts at a speed was stable, and the other chatters no deeper."""
        chatter, stable = (self, other) if self.has_chatter else (other, self)
        is_same_speed = abs(self.speed_rpm / other.speed_rpm - 1) <= PROGRAM_SPEED_TOLERANCE
        return self.has_chatter != other.has_chatter and is_same_speed and not chatter.depth > stable.depth


class NextSpeed(NamedTuple):
    """Speed to try next, with what to expect."""

    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut to try there (m); NaN if the depth of the cuts is unknown."""
    lobe: int
    """Number k of whole waves of the nearest mode between two teeth."""
    frequency: float
    """Natural frequency of that mode (Hz), estimated from the chatter frequencies."""
    relative_depth: float
    """Estimated stable depth over that at the speed of the newest chattering cut."""
    window_rpm: tuple[float, float]
    """Slowest and fastest speed (rpm) with at least `WINDOW_SHARE` of the stable depth."""


class NextSpeeds(NamedTuple):
    """Speeds to try next, best first, or the reason why there are none."""

    reason: str
    """Code of the reason. Empty, or with a smaller depth "no-deep-speed" or "no-speed-in-range" (no pocket inside):
    there are speeds. Without speeds: "stable" (nothing left to try), "no-verdict" (no cut), "no-chatter-frequency"."""
    range_rpm: tuple[float, float]
    """Slowest and fastest speed (rpm) searched."""
    speeds: tuple[NextSpeed, ...] = ()
    """Speeds to try."""
    contradicting: tuple[HeardCut, ...] = ()
    """Stable cuts that a chattering one contradicts; they do not count."""


def suggest_speeds(cuts: Sequence[HeardCut], teeth: int, range_rpm: tuple[float, float]) -> NextSpeeds:
    """Suggest the next speeds and their depth from all cuts so far.

    Parameters
    ----------
    cuts
        Cuts of one tool, material and radial depth, oldest first.
    teeth
        Number of teeth N.
    range_rpm
        Slowest and fastest speed (rpm).

    Examples
    --------
    >>> heard = HeardCut(speed_rpm=18000.0, verdict="chatter", frequency=1370.0, depth=1e-3)
    >>> best = suggest_speeds([heard], 2, (8000.0, 24000.0)).speeds[0]
    >>> best.lobe, round(best.speed_rpm, -3), best.depth  # classic rule: 60 x 1370 / (2 x 2) = 20 550 rpm
    (2, 20000.0, 0.001)
    """
    low, high = range_rpm
    if not (teeth >= 1 and 0 < low < high < math.inf):
        raise ValueError(f"teeth={teeth}, range_rpm={low:g}..{high:g} are invalid. Give teeth >= 1 and a rising range.")
    if not cuts:
        return NextSpeeds("no-verdict", range_rpm)
    valid, contradicting = _drop_contradicted(cuts)
    modes = _find_modes(valid, teeth)
    if valid and not valid[-1].has_chatter:
        return NextSpeeds("stable", range_rpm, (), contradicting)
    if not modes:
        return NextSpeeds("no-chatter-frequency", range_rpm, (), contradicting)
    reason = _find_remark(valid, modes, teeth, range_rpm)
    speeds = _find_deepest_speeds(valid, modes, teeth, range_rpm, _choose_depth(valid, reason))
    return NextSpeeds(reason, range_rpm, speeds, contradicting)


def _drop_contradicted(cuts: Sequence[HeardCut]) -> tuple[list[HeardCut], tuple[HeardCut, ...]]:
    """Return the cuts without the stable ones that chatter contradicts, and these."""
    contradicting = [cut for cut in cuts if not cut.has_chatter and any(map(cut.contradicts, cuts))]
    return [cut for cut in cuts if cut not in contradicting], tuple(contradicting)


def _find_modes(cuts: Sequence[HeardCut], teeth: int) -> list[float]:
    """Estimate the natural frequencies (Hz) from the chatter frequencies."""
    groups: list[list[float]] = []
    for cut in cuts:
        if cut.has_chatter and math.isfinite(cut.frequency):
            tooth = teeth * cut.speed_rpm / 60
            for group in groups:
                distance, near = min(_distances(cut.frequency, tooth, float(np.mean(group))))
                if distance < 1:
                    group.append(near)
                    break
            else:
                groups.append([cut.frequency])
    return [float(np.mean(group)) / CHATTER_OVER_NATURAL for group in groups]


def _distances(frequency: float, tooth: float, known: float) -> list[tuple[float, float]]:
    """Return the distances of a chatter frequency and its side bands from a known one, over the tolerance."""
    sidebands = [value for value in (abs(frequency - tooth), frequency + tooth) if value > 0]
    own = abs(math.log(frequency / known)) / SAME_MODE_TOLERANCE, frequency
    return [own, *((abs(math.log(value / known)) / SIDEBAND_TOLERANCE, value) for value in sidebands)]


def _find_remark(cuts: Sequence[HeardCut], modes: Sequence[float], teeth: int, range_rpm: tuple[float, float]) -> str:
    """Return the code of the reason for a smaller depth; empty if it stays."""
    bases = [60 * frequency / teeth for frequency in modes]
    if not any(math.floor(base / range_rpm[0]) >= max(math.ceil(base / range_rpm[1]), 1) for base in bases):
        return "no-speed-in-range"
    depth = cuts[-1].depth
    n_tries = sum(cut.has_chatter and not cut.depth > depth for cut in cuts)
    return "no-deep-speed" if n_tries >= MAX_CUTS_AT_DEPTH else ""


def _choose_depth(cuts: Sequence[HeardCut], reason: str) -> float:
    """Return the depth to try (m): that of the first cut once, then always a smaller one."""
    depth = cuts[-1].depth
    n_chatter = sum(cut.has_chatter for cut in cuts)
    if not math.isfinite(depth) or (n_chatter < MIN_CUTS_BEFORE_LESS and not reason):
        return depth
    less = 1e3 * NEXT_DEPTH_FACTOR * depth
    return (round_down_depth_mm(less) or less) / 1e3


def _find_deepest_speeds(
    cuts: Sequence[HeardCut], modes: Sequence[float], teeth: int, range_rpm: tuple[float, float], depth: float
) -> tuple[NextSpeed, ...]:
    """Find the speeds most likely to be stable at this depth, if they were not tried at it."""
    speeds = np.geomspace(*range_rpm, math.ceil(math.log(range_rpm[1] / range_rpm[0]) / SPEED_STEP) + 1)
    lobes = sample_lobes(modes[:MAX_MODES], teeth, speeds)
    depths = np.geomspace(1, MAX_LOBE_GAIN, len(lobes.limits))
    weights = _weigh_samples(cuts, teeth, lobes, speeds, depths)
    level = np.asarray(weights @ np.log(lobes.limits))
    chance = _average_over_speeds(_find_chance(weights, lobes.limits, depths * _relative_depth(depth, cuts)))
    newest = next(cut for cut in reversed(cuts) if cut.has_chatter)
    here = float(np.interp(newest.speed_rpm, speeds, level))
    score = np.where(_is_worth_trying(cuts, speeds, teeth), chance, -np.inf)
    found = list[NextSpeed]()
    while len(found) < N_SPEEDS and np.any(np.isfinite(score)):
        place = int(np.argmax(score))
        found.append(_describe(speeds, place, level, modes, teeth, depth, math.exp(level[place] - here)))
        score[_find_pocket(chance, place)] = -np.inf
    return tuple(found)


def _is_worth_trying(cuts: Sequence[HeardCut], speeds: Floats, teeth: int) -> Flags:
    """Return where no cut chattered at the newest depth or a smaller one, after one cut only near the classic rule."""
    tried = [cut.speed_rpm for cut in cuts if cut.has_chatter and not cut.depth > cuts[-1].depth]
    is_new: Flags = np.min([np.abs(np.log(speeds / speed)) for speed in tried], axis=0) >= TRIED_TOLERANCE
    return is_new & _follow_classic_rule(speeds, cuts[0].frequency, teeth) if len(cuts) == 1 else is_new


def _follow_classic_rule(speeds: Floats, frequency: float, teeth: int) -> Flags:
    """Return where tooth passing is close below a whole share of a chatter frequency; everywhere if nowhere."""
    waves = 60 * frequency / (teeth * speeds)
    whole = np.maximum(np.floor(waves), 1)
    is_near = np.abs(np.log(waves / whole)) < CLASSIC_TOLERANCE
    return is_near if np.any(is_near) else np.ones_like(is_near)


def _relative_depth(depth: float, cuts: Sequence[HeardCut]) -> float:
    """Return a depth over that of the first cut; 1 if unknown."""
    ratio = depth / cuts[0].depth
    return ratio if math.isfinite(ratio) else 1.0


def _weigh_samples(cuts: Sequence[HeardCut], teeth: int, lobes: SampledLobes, speeds: Floats, depths: Floats) -> Floats:
    """Return the probability of each sample, by verdict and chatter frequency of each cut."""
    logarithm = np.zeros(depths.size)
    for cut in cuts:
        place = int(np.argmin(np.abs(np.log(speeds / cut.speed_rpm))))
        excess = np.log(depths * _relative_depth(cut.depth, cuts) / lobes.limits[:, place]) / LIMIT_UNCERTAINTY
        logarithm -= np.logaddexp(0, -excess if cut.has_chatter else excess)
        if cut.has_chatter and math.isfinite(cut.frequency):
            logarithm += np.log(_explain_frequency(cut, teeth, lobes.frequencies[:, place]))
    probability = np.exp(logarithm - np.max(logarithm))
    return np.asarray(probability / np.sum(probability))


def _explain_frequency(cut: HeardCut, teeth: int, expected: Floats) -> Floats:
    """Return the likelihood of a chatter frequency or its nearest side bands, by the frequency of each sample (Hz)."""
    tooth = teeth * cut.speed_rpm / 60
    likelihood = np.full(expected.shape, UNEXPLAINED)
    for band, share in zip((0, -1, 1), (1.0, SIDEBAND_LIKELIHOOD, SIDEBAND_LIKELIHOOD), strict=True):
        distance = np.abs(cut.frequency + band * tooth) / expected - 1
        likelihood += share * np.exp(-(np.nan_to_num(distance / FREQUENCY_UNCERTAINTY, nan=np.inf) ** 2) / 2)
    return likelihood


def _find_chance(weights: Floats, limits: Floats, depths: Floats) -> Floats:
    """Return the probability that a cut is stable at each speed, and at least half as deep as the best one."""
    is_deep = depths >= np.max(limits, axis=1) / 2
    return np.asarray(weights @ ((limits >= depths[:, np.newaxis]) & is_deep[:, np.newaxis]))


def _average_over_speeds(chance: Floats) -> Floats:
    """Return a chance averaged over the uncertainty of the speed."""
    return np.asarray(gaussian_filter1d(chance, SPEED_UNCERTAINTY / SPEED_STEP, mode="nearest"))


def _find_pocket(chance: Floats, place: int) -> slice:
    """Return the places around a speed from valley to valley, at most half as high as its chance."""
    rises, is_low = np.diff(chance) > 0, chance < chance[place] / 2
    left = np.flatnonzero(~rises[:place] & is_low[:place])
    right = np.flatnonzero(rises[place:] & is_low[place:-1])
    return slice(int(left.max(initial=-1)) + 1, place + int(right.min(initial=chance.size - 1 - place)) + 1)


def _find_window(level: Floats, place: int) -> tuple[int, int]:
    """Return the first and last place around a speed with at least `WINDOW_SHARE` of its limit."""
    below = np.flatnonzero(level < level[place] + math.log(WINDOW_SHARE))
    first = below[below < place].max(initial=-1) + 1
    return int(first), int(below[below > place].min(initial=level.size)) - 1


def _describe(
    speeds: Floats,
    place: int,
    level: Floats,
    modes: Sequence[float],
    teeth: int,
    depth: float,
    relative_depth: float,
) -> NextSpeed:
    """Describe a speed to try."""
    tooth = teeth * float(speeds[place]) / 60
    frequency = min(modes, key=lambda mode: abs(mode / tooth - max(round(mode / tooth), 1)))
    low, high = float(speeds[0]), float(speeds[-1])
    speed = min(max(round(float(speeds[place]) / SPEED_STEP_RPM) * SPEED_STEP_RPM, low), high)
    first, last = _find_window(level, place)
    window = float(speeds[first]), float(speeds[last])
    return NextSpeed(speed, depth, max(round(frequency / tooth), 1), frequency, relative_depth, window)
