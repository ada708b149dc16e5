"""Match modes between measurements: MAC, followed mode, predominant mode."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Remark
from modal.modes.mode import Mode, add_remark, mode_remark


def mac(a: ArrayLike, b: ArrayLike) -> float:
    """Return the modal assurance criterion |a^H b|^2 / (a^H a b^H b) of two mode shapes.

    Parameters
    ----------
    a, b : array_like, shape (p,)
        Mode shapes over the same points.

    Returns
    -------
    float
        1 for the same shape, 0 for orthogonal ones.

    Raises
    ------
    ValueError
        For shapes of different length, and of zeros.

    References
    ----------
    Allemang & Brown (1982), IMAC 1.

    Examples
    --------
    >>> mac([1.0, 0.5, -0.2], [2.0, 1.0, -0.4])  # the same shape, another scale
    1.0
    >>> mac([1.0, 0.0], [0.0, 1.0])
    0.0
    """
    x, y = np.asarray(a), np.asarray(b)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"mode shapes have {x.shape} and {y.shape} points. Give both shapes over the same points.")
    size = float(np.vdot(x, x).real * np.vdot(y, y).real)
    if not size > 0:
        raise ValueError("a mode shape is zero or not finite. Leave this mode out.")
    return float(np.abs(np.vdot(x, y)) ** 2 / size)


TYPICAL_MODE_CHANGE = (0.03, 0.5, 0.3)
"""Relative changes of frequency, damping ratio and stiffness between measurements that count as distance 1."""
TYPICAL_MAC_LOSS = 0.1
"""1 - MAC that counts as distance 1."""
MAX_MATCH_DISTANCE = 4.0
"""Distance above which a mode is no longer the same."""
DOUBTFUL_MATCH_DISTANCE = 2.5
"""Distance above which a mode may be another one."""
MAX_FOLLOWED_FREQUENCY_CHANGE = 0.15
"""Largest relative change of frequency of an otherwise unchanged mode."""
MAX_GAIN_FREQUENCY_CHANGE = 0.02
"""Largest relative change of frequency of a mode whose stiffness alone has changed, four times a large scatter of
reclamping; chosen."""
MIN_RIVAL_DISTANCE_RATIO = 2.0
"""Distance of the second nearest mode over that of the nearest below which it is a rival."""


@dataclass(frozen=True, eq=False)
class ModeMatch:
    """Mode that continues an earlier one."""

    mode: Mode | None
    """Matching mode; None if no mode is near enough."""
    remarks: tuple[Remark, ...]
    """Reasons why it may be another mode, or why there is none."""


def follow_mode(last: Mode, modes: Sequence[Mode]) -> ModeMatch:
    """Find the mode that continues the last followed one.

    The distance of two modes is the root of the sum of squares of the changes of frequency, damping ratio and
    stiffness,
    each in units of a typical change (stiffness if both know it), and of 1 - MAC if both modes have shapes over
    the same points. A mode that is alike but for its frequency is the same up to 15 %, the largest drop of a spindle.
    One that is alike but for its stiffness is the same within 2 % of the frequency: the gain has changed.

    Parameters
    ----------
    last : Mode
        Mode followed last.
    modes : sequence of Mode
        Modes of the new measurement; only driving points count.

    Returns
    -------
    ModeMatch
        Most similar mode, with a remark if it is doubtful.

    Examples
    --------
    >>> last = Mode(700.0, 0.03, 2e7)
    >>> now = [Mode(650.0, 0.03, 1.8e7), Mode(905.0, 0.02, 6e7)]
    >>> follow_mode(last, now).mode.frequency  # Hz
    650.0
    >>> follow_mode(last, now[1:]).mode is None
    True
    """
    ordered = sorted((m for m in modes if m.is_driving_point), key=lambda mode: _match_distance(last, mode))
    is_near = bool(ordered) and _is_same_mode(last, ordered[0])
    near = ordered if is_near else [mode for mode in ordered if _has_other_gain(last, mode)]
    if not near:
        nearest = f", nearest mode at {ordered[0].frequency:.1f} Hz" if ordered else ""
        text = f"followed mode not found again{nearest}"
        return ModeMatch(None, (mode_remark(last, "no-mode-to-follow", text),))
    first = _match_distance(last, near[0])
    if len(near) > 1 and _match_distance(last, near[1]) < MIN_RIVAL_DISTANCE_RATIO * max(first, 0.5):
        rival = f"{near[1].frequency:.1f} Hz fits the last test ({_values_text(last)}) nearly as well"
        text = f"followed mode is ambiguous: {rival}"
        return ModeMatch(near[0], (mode_remark(near[0], "rival-mode", text),))
    if first > DOUBTFUL_MATCH_DISTANCE:
        text = f"may be another mode: {_values_text(last)} in the last test, now {_values_text(near[0])}"
        return ModeMatch(near[0], (mode_remark(near[0], "large-change", text),))
    return ModeMatch(near[0], ())


def _is_same_mode(last: Mode, mode: Mode) -> bool:
    if _match_distance(last, mode) <= MAX_MATCH_DISTANCE:
        return True
    moved = abs(mode.frequency / last.frequency - 1) <= MAX_FOLLOWED_FREQUENCY_CHANGE
    return moved and _match_distance(replace(last, frequency=mode.frequency), mode) <= DOUBTFUL_MATCH_DISTANCE


def _has_other_gain(last: Mode, mode: Mode) -> bool:
    is_near = abs(mode.frequency / last.frequency - 1) <= MAX_GAIN_FREQUENCY_CHANGE
    return is_near and _match_distance(replace(last, stiffness=mode.stiffness), mode) <= DOUBTFUL_MATCH_DISTANCE


def _values_text(mode: Mode) -> str:
    return f"{mode.frequency:.1f} Hz" + (f" with K {mode.stiffness / 1e6:.3g} N/um" if mode.has_stiffness else "")


def _match_distance(a: Mode, b: Mode) -> float:
    ratios = (b.frequency / a.frequency, b.damping_ratio / a.damping_ratio, b.stiffness / a.stiffness)
    known = 3 if a.has_stiffness and b.has_stiffness else 2
    pairs = list(zip(ratios, TYPICAL_MODE_CHANGE, strict=True))[:known]
    changes = [np.log(ratio) / likely if ratio > 0 else np.inf for ratio, likely in pairs]
    if a.shape is not None and b.shape is not None and a.shape.shape == b.shape.shape:
        changes.append((1 - mac(a.shape, b.shape)) / TYPICAL_MAC_LOSS)
    return float(np.linalg.norm(changes))


MATCHED_FREQUENCY_SHARE = 0.005
"""Relative distance within which two frequencies are the same mode, as required of repeated measurements."""


MIN_FRFS_FOR_ABSENCE = 2
"""Fewest other FRFs that make a mode doubtful because none of them has it; in one it may be at a node."""


def match_modes(modes: Sequence[Mode], others: Sequence[Sequence[Mode]]) -> list[Mode]:
    """Count for each mode how many other FRFs have it within 0.5 %.

    `assess_trust` trusts modes more that others have too. A mode that none of two or more others has gets a remark,
    which makes it doubtful.

    Parameters
    ----------
    modes : sequence of Mode
        Modes of one FRF.
    others : sequence of sequences of Mode
        Modes, of any trust, of other FRFs of the structure: sensors of the same hits, points, repeated measurements.

    Returns
    -------
    list of Mode
        The modes with `match_count`.

    Examples
    --------
    >>> once, twice = Mode(412.0, 0.01, 3e7), Mode(500.0, 0.02, 2e7)
    >>> others = [[Mode(500.4, 0.021, 5e7)], [Mode(499.1, 0.018, -4e7)]]
    >>> [mode.match_count for mode in match_modes([once, twice], others)]
    [(0, 2), (2, 2)]
    """
    return [_with_match_count(mode, others) for mode in modes]


def _with_match_count(mode: Mode, others: Sequence[Sequence[Mode]]) -> Mode:
    found, of = sum(_has_mode_near(modes, mode.frequency) for modes in others), len(others)
    counted = replace(mode, match_count=(found, of))
    if found or of < MIN_FRFS_FOR_ABSENCE:
        return counted
    text = f"none of the {of} other measurements has a mode within {100 * MATCHED_FREQUENCY_SHARE:g} %"
    return add_remark(counted, "not-found-again", text, "Check for mains hum and double hits, and tap again")


def _has_mode_near(modes: Sequence[Mode], frequency: float) -> bool:
    return any(abs(mode.frequency / frequency - 1) < MATCHED_FREQUENCY_SHARE for mode in modes)


def predominant_mode(modes: Sequence[Mode], band: tuple[float, float] | None = None) -> Mode | None:
    """Return the driving-point mode with the largest peak of -Im of receptance, 1/(2 zeta K).

    Parameters
    ----------
    modes : sequence of Mode
        Modes of one FRF.
    band : tuple of float, optional
        Lowest and highest frequency (Hz), ends included.

    Returns
    -------
    Mode or None
        Predominant mode; None if the band holds none.

    Raises
    ------
    ValueError
        For an empty band.

    References
    ----------
    Gaber & Hashemi (2015), "the most predominant mode".

    Examples
    --------
    >>> modes = [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 1e7)]
    >>> predominant_mode(modes).frequency  # Hz: 1 / (2 zeta K) is 1.25 um/N there, and 1.67 at 900 Hz
    900.0
    >>> predominant_mode(modes, band=(0.0, 800.0)).frequency
    500.0
    """
    low, high = band or (0.0, float("inf"))
    if not low < high:
        raise ValueError(f"band {low:g}..{high:g} Hz is empty. Give the lower frequency first.")
    able = [mode for mode in modes if mode.is_driving_point and low <= mode.frequency <= high]
    return max(able, key=lambda mode: mode.peak, default=None)
