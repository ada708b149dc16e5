"""Unequal pitches as tool makers grind them, within limits of chip load and balance."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lobes.cut import Cut

MAX_PITCH_DEVIATION = 0.2
"""Largest relative deviation of a pitch from the mean, and with it of the chip load; chosen."""
MAX_EDGE_IMBALANCE = 0.1
"""Largest eccentricity of the edges over the radius; chosen: grinding has to balance it."""
PITCH_STEPS_PER_HALF_WAVE = 6
"""Steps of the pitch difference per half wave."""
MAX_HALF_WAVES = 3.5
"""Largest pitch difference (half waves); beyond it the uncertainty of the frequency removes the gain."""
COARSE_PITCH_STEP_DEG, FINE_PITCH_STEP_DEG = 1.0, 0.2
"""Steps of pitch differences (deg); the fine one applies if half a wave is less than six coarse ones."""


@dataclass(frozen=True)
class PitchPattern:
    """Pitches of a cutter, with chip load and balance."""

    pitch_deg: tuple[float, ...]
    """Angle from each tooth to the previous one (deg), in order of entry."""
    name: str
    """Name: "equal", "alternating", "linear", "linear, 2 times" (the same steps twice per turn), "as it is"."""

    @property
    def feed_ratio_range(self) -> tuple[float, float]:
        """Smallest and largest feed of a tooth over the mean feed per tooth (-)."""
        mean = sum(self.pitch_deg) / len(self.pitch_deg)
        return min(self.pitch_deg) / mean, max(self.pitch_deg) / mean

    @property
    def imbalance(self) -> float:
        """Eccentricity of the edges over the tool radius (-); 0 is balanced."""
        edges = np.exp(1j * np.radians(np.cumsum(self.pitch_deg)))
        return round(float(abs(np.mean(edges))), 12)


def half_wave_deg(speed_rpm: float, chatter_frequency: float) -> float:
    """Return the difference of neighbouring pitches that shifts chatter by half a wave.

    The closed form of the best difference for an even number of teeth: the waves that two neighbours leave cancel.

    Parameters
    ----------
    speed_rpm : float
        Spindle speed (rpm).
    chatter_frequency : float
        Chatter frequency (Hz).

    Returns
    -------
    float
        Pitch difference (deg).

    References
    ----------
    Budak, An analytical design method for milling cutters with nonconstant pitch to increase stability,
    J. Manuf. Sci. Eng. 125 (2003) 29-34, after Altintas, Engin & Budak, J. Manuf. Sci. Eng. 121 (1999) 173-178.

    Examples
    --------
    >>> half_wave_deg(6000.0, 1000.0)  # degrees: ten waves a turn, each of 36
    18.0
    """
    return 180 * speed_rpm / 60 / chatter_frequency


def pitch_patterns(teeth: int, half_wave: float) -> Iterator[PitchPattern]:
    """Yield pitch patterns whose neighbouring pitches differ by up to a few half waves.

    Pitches rise by equal steps over blocks of teeth that divide the number of teeth; two of them alternate.
    Patterns beyond `MAX_PITCH_DEVIATION` or `MAX_EDGE_IMBALANCE` are left out.

    Parameters
    ----------
    teeth : int
        Number of teeth.
    half_wave : float
        Pitch difference of half a wave (deg), see `half_wave_deg`.

    Returns
    -------
    iterator of PitchPattern
        Patterns.

    Raises
    ------
    ValueError
        For less than two teeth.

    Examples
    --------
    >>> patterns = list(pitch_patterns(4, half_wave_deg(6000.0, 1800.0)))
    >>> [(pattern.name, pattern.pitch_deg) for pattern in (patterns[5], patterns[-1])]  # degrees
    [('alternating', (85.0, 95.0, 85.0, 95.0)), ('linear', (75.0, 85.0, 95.0, 105.0))]
    """
    if teeth < 2:
        raise ValueError(f"teeth={teeth} has no pitch to vary. Give a tool with at least 2 flutes.")
    is_coarse = half_wave >= PITCH_STEPS_PER_HALF_WAVE * COARSE_PITCH_STEP_DEG
    unit = COARSE_PITCH_STEP_DEG if is_coarse else FINE_PITCH_STEP_DEG
    wanted = half_wave * np.arange(1, PITCH_STEPS_PER_HALF_WAVE * MAX_HALF_WAVES + 1) / PITCH_STEPS_PER_HALF_WAVE
    for block in (number for number in range(2, teeth + 1) if teeth % number == 0):
        for difference in np.unique(np.maximum(np.round(wanted / unit), 1)) * unit:
            pattern = _block_pattern(teeth, block, float(difference))
            low, high = pattern.feed_ratio_range
            if max(1 - low, high - 1) <= MAX_PITCH_DEVIATION + 1e-9 and pattern.imbalance <= MAX_EDGE_IMBALANCE:
                yield pattern


def _block_pattern(teeth: int, block: int, difference: float) -> PitchPattern:
    steps = difference * (np.arange(block) - (block - 1) / 2)
    pitch = np.round(360 / teeth + np.tile(steps, teeth // block), 2)
    pitch[-1] = round(360 - float(np.sum(pitch[:-1])), 2)
    name = "alternating" if block == 2 else "linear" if block == teeth else f"linear, {teeth // block} times"
    return PitchPattern(tuple(pitch.tolist()), name)


def equal_pitch(teeth: int) -> PitchPattern:
    """Return the pattern of evenly spaced teeth.

    Parameters
    ----------
    teeth : int
        Number of teeth.

    Returns
    -------
    PitchPattern
        Pitches of 360 / teeth degrees.

    Examples
    --------
    >>> equal_pitch(4).pitch_deg
    (90.0, 90.0, 90.0, 90.0)
    """
    return PitchPattern((360 / teeth,) * teeth, "equal")


def with_pitch_pattern(cut: Cut, pattern: PitchPattern) -> Cut:
    """Return a cut by a cutter with these pitches.

    Parameters
    ----------
    cut : Cut
        Cut by any pitches.
    pattern : PitchPattern
        New pitches.

    Returns
    -------
    Cut
        Same cut with the new pitches.

    Examples
    --------
    >>> side = Cut(teeth=4, immersion=0.25, direction="down", tangential=700e6, radial=200e6)
    >>> uneven = with_pitch_pattern(side, PitchPattern((85.0, 95.0, 85.0, 95.0), "alternating"))
    >>> uneven.repeats_per_turn, np.degrees(uneven.delays).round(6).tolist()  # times in a turn, degrees
    (2, [85.0, 95.0])
    """
    return replace(cut, pitch=tuple(np.radians(pattern.pitch_deg).tolist()))
