"""Decide which modes are trusted, and select those used for lobes."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from acquisition import Remark, stiffness_remark
from modal.modes.mode import Mode

REJECTED_MISFIT_SHARE = 0.3
"""What the fit leaves in the band, where it is more than noise, as a share of the peak of the mode; less is in its
errors."""
REJECTED_HIDDEN_MISFIT_SHARE = 0.05
"""The same of a mode without a peak of its own."""
ROTATED_PHASE_DEG = 30.0
"""Phase of the modal constant off real (degrees) beyond which a mode must be known well: what noise and the flanks of
others make has any phase."""
MAX_ROTATED_MODE_ERROR, REJECTED_MODE_ERROR = 0.1, 1 / 3
"""Relative standard error of damping ratio or stiffness, the larger one: of a turned mode, and of any."""
REJECTED_MATCHED_MODE_ERROR = 0.5
"""The same of a mode that is found again, turned or not."""
MIN_OTHER_FRFS, MIN_MATCHED_SHARE = 2, 0.75
"""Other FRFs of the structure, and their share that has a mode, from which it is found again: one alone has a mode
within 0.5 % by chance in one case of five."""
DOUBTFUL_HIDDEN_DAMPING, REJECTED_HIDDEN_DAMPING = 0.08, 0.15
"""Damping ratio of a mode without a peak of its own; machine structures have 0.005 to 0.08."""
MAX_MODE_DAMPING = 0.3
"""Damping ratio that no peak makes a mode."""
MIN_TRUSTED_COHERENCE = 0.5
"""Mean coherence at the peak below which most of what was measured is not the hammer's."""
MAX_REMAINING_DECAY = 0.05
"""Share of the decay left when the record ends that the errors of the mode stand for."""
MAX_MISFIT_RATIO = 2.0
"""rms of what the fit leaves over rms of the noise that is more than noise; it matters ..."""
MIN_MISFIT_SHARE = 0.01
"""... from this share of the peak; on the zeta and K of a mode without a peak of its own it bears more."""
DOUBTFUL_REMARK_CODES = ("bent-by-neighbour", "several-modes", "smoothed-lines")
"""Remarks that stand for a figure which a mode does not carry; those of ..."""
COMMON_REMARK_CODES = ("smoothed-lines",)
"""... what is alike in all FRFs of a structure, so that to find it again says nothing."""


class Trust(enum.StrEnum):
    """How far a mode can be believed."""

    TRUSTED = "trusted"
    """Its values hold within their errors."""
    DOUBTFUL = "doubtful"
    """There is a mode; its zeta or K may be off by more than their errors say."""
    REJECTED = "rejected"
    """Not to be told from what the fit cannot explain: no decision should rest on it."""


def assess_trust(mode: Mode) -> Trust:
    """The worst verdict of all rules, from figures and codes alone; the table of docs/modal.md says why each.

    >>> assess_trust(Mode(500.0, 0.02, 2e7, misfit=1.0, misfit_share=0.01))
    <Trust.TRUSTED: 'trusted'>
    >>> assess_trust(Mode(500.0, 0.02, 2e7, misfit=30.0, misfit_share=0.5))
    <Trust.REJECTED: 'rejected'>
    """
    verdicts = {verdict for _, verdict in trust_rules(mode)}
    return next((trust for trust in (Trust.REJECTED, Trust.DOUBTFUL) if trust in verdicts), Trust.TRUSTED)


def trust_rules(mode: Mode) -> Iterator[tuple[str, Trust]]:
    """What speaks against a mode, as codes of remarks, each with the verdict that it alone would bring.

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
    """Whether so many other FRFs of the structure have it that it is no chance.

    >>> is_matched(Mode(500.0, 0.02, 2e7, match_modes=(3, 4))), is_matched(Mode(500.0, 0.02, 2e7))
    (True, False)
    """
    found, of = mode.match_count or (0, 0)
    return of >= MIN_OTHER_FRFS and found >= MIN_MATCHED_SHARE * of


def _figure_limits(mode: Mode) -> Iterator[tuple[str, float, float, float]]:
    """Code, value, and the limits above which it makes a mode doubtful and rejected."""
    never, again = float("inf"), is_matched(mode)
    share = (mode.misfit_share or 0.0) if (mode.misfit or 1.0) > MAX_MISFIT_RATIO else 0.0
    if again or mode.half_power_damping is not None or mode.misfit is None:
        yield "misfit", share, REJECTED_MISFIT_SHARE, REJECTED_MISFIT_SHARE
        yield "heavy-damping", mode.damping_ratio, MAX_MODE_DAMPING, MAX_MODE_DAMPING
    else:
        yield "misfit", share, MIN_MISFIT_SHARE, REJECTED_HIDDEN_MISFIT_SHARE
        yield "heavy-damping", mode.damping_ratio, DOUBTFUL_HIDDEN_DAMPING, REJECTED_HIDDEN_DAMPING
    largest = REJECTED_MATCHED_MODE_ERROR if again else REJECTED_MODE_ERROR
    is_turned = abs(mode.phase_deg) > ROTATED_PHASE_DEG and not again
    yield "uncertain", relative_error(mode), MAX_ROTATED_MODE_ERROR if is_turned else largest, largest
    if mode.coherence is not None:
        yield "low-coherence", 1 - mode.coherence, 1 - MIN_TRUSTED_COHERENCE, never
    if mode.edge_distance is not None:
        yield "cut-by-edge", 1 - mode.edge_distance, 0.0, 1.0
    yield "still-ringing", mode.remaining_decay or 0.0, MAX_REMAINING_DECAY, never


def relative_error(mode: Mode) -> float:
    """The larger of the relative standard errors of damping ratio and stiffness (-), of what is known; 0 where not
    estimated."""
    if mode.best_covariance is None:
        return 0.0
    _, damping, stiffness = mode.standard_error
    shares = float(damping) / mode.damping_ratio, float(stiffness) / abs(mode.stiffness)
    return max(shares) if mode.has_stiffness else shares[0]


REJECTION_REASONS = {
    "heavy-damping": "drift has no peak either",
    "misfit": "the fit leaves too much of it",
    "uncertain": "its damping or stiffness is hardly known",
}
"""Why a mode is rejected, in words, by the rule of `trust_rules`."""
MAX_NEGATIVE_PEAK_SHARE = 0.1
"""Peak of a mode with negative stiffness over the largest, below which it is left out; chosen."""
REJECTED_MODE_REMEDY = (
    "look at it with lobewatch modes --figure; against drift let the sensor rest longer, or change its cable"
)


@dataclass(frozen=True, eq=False)
class CredibleModes:
    """The modes of one FRF that may be believed."""

    modes: tuple[Mode, ...]
    """Modes that may be followed, calibrated and used for lobes."""
    opposed: tuple[Mode, ...]
    """Modes that could be, were their stiffness not negative: no driving point. Small ones are left out."""
    remarks: tuple[Remark, ...]
    """One about each of the rest, with the reason."""


def select_credible_modes(modes: Sequence[Mode]) -> CredibleModes:
    """Leave out drift, peaks cut by the edge of the lines, stiffness of no machine, and what trust_of rejects.

    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], np.arange(1.0, 1501.0))
    >>> [round(mode.frequency) for mode in select_credible_modes(fit_modes(frf)).modes]  # Hz
    [500, 900]
    >>> select_credible_modes([Mode(500.0, 0.02, 2.0)]).remarks[0].code  # N/um taken for N/m
    'stiffness-not-believed'
    """
    judged = [(mode, _rejection_remark(mode)) for mode in modes]
    plausible = [mode for mode, doubt in judged if doubt is None]
    largest = max((mode.peak for mode in plausible), default=0.0)
    against = [mode for mode in plausible if not mode.is_driving_point]
    small = [mode for mode in against if mode.peak < MAX_NEGATIVE_PEAK_SHARE * largest]
    return CredibleModes(
        tuple(mode for mode in plausible if mode.is_driving_point),
        tuple(mode for mode in against if mode not in small),
        (
            *(doubt for _, doubt in judged if doubt is not None),
            *(_opposed_mode_remark(mode, largest) for mode in small),
        ),
    )


def _opposed_mode_remark(mode: Mode, largest: float) -> Remark:
    text = f"left out: K is negative, its peak {100 * mode.peak / largest:.1g} % of the largest"
    cure = "where it is a mode of the machine, hit and measure at one point in one direction"
    return Remark("small-against", f"{mode.frequency:.4g} Hz", text, cure)


def _rejection_remark(mode: Mode) -> Remark | None:
    """Why a mode is not believed; None where it is."""
    at = f"{mode.frequency:.4g} Hz"
    stiffness = stiffness_remark(mode.stiffness) if mode.has_stiffness else None
    reasons = [REJECTION_REASONS.get(code, code) for code, verdict in trust_rules(mode) if verdict is Trust.REJECTED]
    if any(remark.code == "cut-by-edge" for remark in mode.remarks):
        reasons.append("its peak is cut by the edge of the lines")
    if reasons:
        text = f"not followed and not used for lobes, damping {100 * mode.damping_ratio:.2g} %: {', '.join(reasons)}"
        return Remark("mode-not-believed", at, text, REJECTED_MODE_REMEDY)
    return None if stiffness is None else Remark(stiffness.code, at, stiffness.text, stiffness.cure)
