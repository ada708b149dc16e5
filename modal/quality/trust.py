"""Decide which modes are trusted, and select those used for lobes."""

import enum
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from acquisition import Remark, stiffness_remark
from modal.modes.mode import Mode

REJECTED_MISFIT_SHARE = 0.3
"""Rejected residual near a mode, where it is more than noise, over its peak; less is in its errors."""
REJECTED_HIDDEN_MISFIT_SHARE = 0.05
"""Rejected residual near a mode without a peak of its own, over its height."""
ROTATED_PHASE_DEG = 30.0
"""Phase of the modal constant (degrees) beyond which a mode must be certain: noise and flanks have any phase."""
MAX_ROTATED_MODE_ERROR, REJECTED_MODE_ERROR = 0.1, 1 / 3
"""Largest relative standard error of damping ratio or stiffness of a rotated mode, and of any mode."""
REJECTED_MATCHED_MODE_ERROR = 0.5
"""Rejected relative standard error of a mode that other FRFs have, too, or that moves during the measurement."""
MOVING_MODE_CODES = ("uneven-peak", "several-modes", "scatter")
"""Codes of remarks on modes that exist, but stand for several modes or states, whose spread is in their errors."""
MIN_OTHER_FRFS, MIN_MATCHED_SHARE = 2, 0.75
"""Number of other FRFs, and their share with the mode, from which it is matched.

A single other FRF has a mode within 0.5 % by chance in one case of five.
"""
DOUBTFUL_HIDDEN_DAMPING, REJECTED_HIDDEN_DAMPING = 0.08, 0.15
"""Doubtful and rejected damping ratio of a mode without a peak; machine structures have 0.005 to 0.08."""
MAX_MODE_DAMPING = 0.3
"""Largest damping ratio of a mode."""
MIN_TRUSTED_COHERENCE = 0.5
"""Least mean coherence at the peak; below it most of the response is not caused by the hammer."""
MAX_REMAINING_DECAY = 0.05
"""Largest share of the decay after the record that the errors of a mode account for."""
MAX_MISFIT_RATIO = 2.0
"""Residual rms over noise rms above which the residual is more than noise."""
MIN_MISFIT_SHARE = 0.01
"""Residual rms over the peak from which a misfit counts."""
DOUBTFUL_REMARK_CODES = (
    "bent-by-neighbour",
    "several-modes",
    "smoothed-lines",
    "not-found-again",
    "wrong-quantity",
    "wrong-unit",
)
"""Codes of remarks that make a mode doubtful."""
COMMON_REMARK_CODES = ("smoothed-lines", "wrong-quantity", "wrong-unit")
"""Codes of remarks on all FRFs of a structure, for which a match in another FRF proves nothing."""


class Trust(enum.StrEnum):
    """Trust in a mode."""

    TRUSTED = "trusted"
    """Values hold within their errors."""
    DOUBTFUL = "doubtful"
    """A mode exists; its zeta or K may be off by more than their errors."""
    REJECTED = "rejected"
    """Mode cannot be distinguished from what the fit does not explain; no decision may rest on it."""


def assess_trust(mode: Mode) -> Trust:
    """Return the worst verdict of all trust rules. The table in docs/studies/modal.md gives the reasons.

    Parameters
    ----------
    mode : Mode
        Mode with quality figures and remarks.

    Returns
    -------
    Trust
        Verdict.

    Examples
    --------
    >>> assess_trust(Mode(500.0, 0.02, 2e7, misfit=1.0, misfit_share=0.01))
    <Trust.TRUSTED: 'trusted'>
    >>> assess_trust(Mode(500.0, 0.02, 2e7, misfit=30.0, misfit_share=0.5))
    <Trust.REJECTED: 'rejected'>
    """
    verdicts = {verdict for _, verdict in trust_rules(mode)}
    return next((trust for trust in (Trust.REJECTED, Trust.DOUBTFUL) if trust in verdicts), Trust.TRUSTED)


def trust_rules(mode: Mode) -> Iterator[tuple[str, Trust]]:
    """Yield the rules that a mode violates.

    Parameters
    ----------
    mode : Mode
        Mode with quality figures and remarks.

    Yields
    ------
    tuple of str and Trust
        Code of the remark, and the verdict of this rule.

    Examples
    --------
    >>> list(trust_rules(Mode(500.0, 0.02, 2e7, misfit=30.0, misfit_share=0.5)))
    [('misfit', <Trust.REJECTED: 'rejected'>)]
    """
    for code, value, doubtful, rejected in _figure_limits(mode):
        if value > doubtful:
            yield code, Trust.REJECTED if value > rejected else Trust.DOUBTFUL
    for remark in mode.remarks:
        if remark.code in (COMMON_REMARK_CODES if is_matched(mode) else DOUBTFUL_REMARK_CODES):
            yield remark.code, Trust.DOUBTFUL


def is_matched(mode: Mode) -> bool:
    """Return whether so many other FRFs of the structure have the mode that it is no chance.

    >>> is_matched(Mode(500.0, 0.02, 2e7, match_count=(3, 4))), is_matched(Mode(500.0, 0.02, 2e7))
    (True, False)
    """
    found, of = mode.match_count or (0, 0)
    return of >= MIN_OTHER_FRFS and found >= MIN_MATCHED_SHARE * of


def _figure_limits(mode: Mode) -> Iterator[tuple[str, float, float, float]]:
    """Yield code, value, and the limits above which it makes a mode doubtful and rejected."""
    never, again = float("inf"), is_matched(mode)
    share = (mode.misfit_share or 0.0) if (mode.misfit or 1.0) > MAX_MISFIT_RATIO else 0.0
    if again or mode.half_power_damping is not None or mode.misfit is None:
        yield "misfit", share, REJECTED_MISFIT_SHARE, REJECTED_MISFIT_SHARE
        yield "heavy-damping", mode.damping_ratio, MAX_MODE_DAMPING, MAX_MODE_DAMPING
    else:
        yield "misfit", share, MIN_MISFIT_SHARE, REJECTED_HIDDEN_MISFIT_SHARE
        yield "heavy-damping", mode.damping_ratio, DOUBTFUL_HIDDEN_DAMPING, REJECTED_HIDDEN_DAMPING
    doubtful = REJECTED_MATCHED_MODE_ERROR if again else REJECTED_MODE_ERROR
    is_moving = any(remark.code in MOVING_MODE_CODES for remark in mode.remarks)
    rejected = REJECTED_MATCHED_MODE_ERROR if is_moving else doubtful
    is_turned = abs(mode.phase_deg) > ROTATED_PHASE_DEG and not again
    yield "uncertain", relative_error(mode), MAX_ROTATED_MODE_ERROR if is_turned else doubtful, rejected
    if mode.coherence is not None:
        yield "low-coherence", 1 - mode.coherence, 1 - MIN_TRUSTED_COHERENCE, never
    if mode.edge_distance is not None:
        yield "cut-by-edge", 1 - mode.edge_distance, 0.0, 1.0
    yield "still-ringing", mode.remaining_decay or 0.0, MAX_REMAINING_DECAY, never


def relative_error(mode: Mode) -> float:
    """Return the larger relative standard error of damping ratio and stiffness (-), 0 if not estimated."""
    if mode.best_covariance is None:
        return 0.0
    _, damping, stiffness = mode.standard_error
    shares = float(damping) / mode.damping_ratio, float(stiffness) / abs(mode.stiffness)
    return max(shares) if mode.has_stiffness else shares[0]


REJECTION_REASONS = {
    "heavy-damping": "no clear peak, may be sensor drift",
    "misfit": "poor fit",
    "uncertain": "damping or stiffness too uncertain",
}
"""Text for each rule of `trust_rules` that rejects a mode."""
MAX_NEGATIVE_PEAK_SHARE = 0.1
"""Peak of a mode with negative stiffness over the largest, below which it is left out; chosen."""
REJECTED_MODE_REMEDY = (
    "Check the peak with modal.synthesize_frf. Against drift, let the sensor settle or change its cable"
)

DIFFERENT_HITS_REMEDY = "Let the spindle warm up, check the clamping, and tap again with at least four hits"


@dataclass(frozen=True, eq=False)
class CredibleModes:
    """Modes of one FRF that can be used."""

    modes: tuple[Mode, ...]
    """Modes that can be followed, calibrated and used for lobes."""
    opposed: tuple[Mode, ...]
    """Credible modes with negative stiffness: no driving point. Small ones are left out."""
    remarks: tuple[Remark, ...]
    """One remark with the reason for each of the other modes."""


def select_credible_modes(modes: Sequence[Mode]) -> CredibleModes:
    """Select the modes that can be followed, calibrated and used for lobes.

    Leaves out drift, peaks cut by the edge of the lines, stiffnesses of no machine, and modes rejected by
    `assess_trust`.

    Parameters
    ----------
    modes : sequence of Mode
        Modes of one FRF.

    Returns
    -------
    CredibleModes
        Selected modes, and a remark on each of the others.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], np.arange(1.0, 1501.0))
    >>> [round(mode.frequency) for mode in select_credible_modes(fit_modes(frf)).modes]  # Hz
    [500, 900]
    >>> select_credible_modes([Mode(500.0, 0.02, 2.0)]).remarks[0].code  # N/um taken for N/m
    'stiffness-not-believed'
    """
    rejections = [_rejection_remark(mode) for mode in modes]
    credible = [mode for mode, rejection in zip(modes, rejections, strict=True) if rejection is None]
    largest = max((mode.peak for mode in credible), default=0.0)
    opposed = [mode for mode in credible if not mode.is_driving_point]
    small = [mode for mode in opposed if mode.peak < MAX_NEGATIVE_PEAK_SHARE * largest]
    return CredibleModes(
        tuple(mode for mode in credible if mode.is_driving_point),
        tuple(mode for mode in opposed if mode not in small),
        (*filter(None, rejections), *(_opposed_mode_remark(mode, largest) for mode in small)),
    )


def _opposed_mode_remark(mode: Mode, largest: float) -> Remark:
    text = f"mode left out: stiffness K is negative, peak only {100 * mode.peak / largest:.1g} % of the largest peak"
    cure = "If the mode belongs to the machine, hit and measure at the same point in the same direction"
    return Remark("small-against", f"{mode.frequency:.4g} Hz", text, cure)


STIFFNESS_CAUSE_CODES = ("wrong-quantity", "wrong-unit")
"""Codes of remarks that explain an implausible stiffness."""


def _rejection_remark(mode: Mode) -> Remark | None:
    """Return the reason why a mode is not credible; None if it is."""
    at = f"{mode.frequency:.4g} Hz"
    stiffness = stiffness_remark(mode.stiffness) if mode.has_stiffness else None
    cause = next((remark for remark in mode.remarks if remark.code in STIFFNESS_CAUSE_CODES), stiffness)
    reasons = [REJECTION_REASONS.get(code, code) for code, verdict in trust_rules(mode) if verdict is Trust.REJECTED]
    if any(remark.code == "cut-by-edge" for remark in mode.remarks):
        reasons.append("peak cut off at the edge of the fitted band")
    if _is_rejected_by_hits(mode):
        text = f"mode not used, because the hits differ: standard error of zeta or K {100 * relative_error(mode):.0f} %"
        return Remark("mode-differs-over-hits", at, text, DIFFERENT_HITS_REMEDY)
    if reasons:
        text = f"mode not used, zeta {100 * mode.damping_ratio:.2g} %: {', '.join(reasons)}"
        return Remark("mode-not-believed", at, text, REJECTED_MODE_REMEDY)
    return None if stiffness is None else Remark(stiffness.code, at, stiffness.text, (cause or stiffness).cure)


def _is_rejected_by_hits(mode: Mode) -> bool:
    """Return whether a mode is too uncertain because the hits differ.

    Then the fit to their mean is certain, or the coherence is low and the peak is not that of one mode. Noise lowers
    the coherence, too, but leaves no misfit. A window makes an uneven peak, but lowers no coherence.
    """
    rejection = ("uncertain", Trust.REJECTED)
    if mode.jackknife is None or rejection not in trust_rules(mode):
        return False
    codes = {remark.code for remark in mode.remarks}
    is_uneven = "low-coherence" in codes and bool(codes & {"misfit", *MOVING_MODE_CODES})
    return is_uneven or rejection not in trust_rules(replace(mode, jackknife=None))
