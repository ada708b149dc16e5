"""Which modes to believe, decided in one place from the figures of each."""

from __future__ import annotations

import enum
from collections.abc import Iterator

from modal.modes.mode import Mode

REJECTED_SHARE = 0.3
"""What the fit leaves in the band, where it is more than noise, as a share of the peak of the mode; less is in its
errors."""
REJECTED_WITHOUT_PEAK = 0.05
"""The same of a mode without a peak of its own."""
TURNED = 30.0
"""Phase of the modal constant off real (degrees) beyond which a mode must be known well: what noise and the flanks of
others make has any phase."""
WELL_KNOWN, REJECTED_ERROR = 0.1, 1 / 3
"""Relative standard error of damping ratio or stiffness, the larger one: of a turned mode, and of any."""
REJECTED_ERROR_AGAIN = 0.5
"""The same of a mode that is found again, turned or not."""
FEWEST_OTHERS, AGAIN = 2, 0.75
"""Other FRFs of the structure, and their share that has a mode, from which it is found again: one alone has a mode
within 0.5 % by chance in one case of five."""
DOUBTFUL_DAMPING, REJECTED_DAMPING = 0.08, 0.15
"""Damping ratio of a mode without a peak of its own; machine structures have 0.005 to 0.08."""
HEAVY_DAMPING = 0.3
"""Damping ratio that no peak makes a mode."""
LEAST_COHERENCE = 0.5
"""Mean coherence at the peak below which most of what was measured is not the hammer's."""
MOST_LEFT = 0.05
"""Share of the decay left when the record ends that the errors of the mode stand for."""
MISFIT = 2.0
"""rms of what the fit leaves over rms of the noise that is more than noise; it matters ..."""
MISFIT_SHARE = 0.01
"""... from this share of the peak; on the zeta and K of a mode without a peak of its own it bears more."""
DOUBTFUL_CODES = ("bent-by-neighbour", "several-modes", "smoothed-lines")
"""Remarks that stand for a figure which a mode does not carry; those of ..."""
ALIKE_CODES = ("smoothed-lines",)
"""... what is alike in all FRFs of a structure, so that to find it again says nothing."""


class Trust(enum.StrEnum):
    """How far a mode can be believed."""

    TRUSTED = "trusted"
    """Its values hold within their errors."""
    DOUBTFUL = "doubtful"
    """There is a mode; its zeta or K may be off by more than their errors say."""
    REJECTED = "rejected"
    """Not to be told from what the fit cannot explain: no decision should rest on it."""


def trust_of(mode: Mode) -> Trust:
    """The worst verdict of all rules, from figures and codes alone; the table of docs/modal.md says why each.

    >>> trust_of(Mode(500.0, 0.02, 2e7, misfit=1.0, misfit_share=0.01))
    <Trust.TRUSTED: 'trusted'>
    >>> trust_of(Mode(500.0, 0.02, 2e7, misfit=30.0, misfit_share=0.5))
    <Trust.REJECTED: 'rejected'>
    """
    verdicts = {verdict for _, verdict in trust_rules(mode)}
    return next((trust for trust in (Trust.REJECTED, Trust.DOUBTFUL) if trust in verdicts), Trust.TRUSTED)


def trust_rules(mode: Mode) -> Iterator[tuple[str, Trust]]:
    """What speaks against a mode, as codes of remarks, each with the verdict that it alone would bring.

    >>> list(trust_rules(Mode(500.0, 0.02, 2e7, misfit=30.0, misfit_share=0.5)))
    [('misfit', <Trust.REJECTED: 'rejected'>)]
    """
    for code, value, doubtful, rejected in _limits(mode):
        if value > doubtful:
            yield code, Trust.REJECTED if value > rejected else Trust.DOUBTFUL
    for remark in mode.remarks:
        if remark.code in (ALIKE_CODES if is_found_again(mode) else DOUBTFUL_CODES):
            yield remark.code, Trust.DOUBTFUL


def is_found_again(mode: Mode) -> bool:
    """Whether so many other FRFs of the structure have it that it is no chance.

    >>> is_found_again(Mode(500.0, 0.02, 2e7, found_again=(3, 4))), is_found_again(Mode(500.0, 0.02, 2e7))
    (True, False)
    """
    found, of = mode.found_again or (0, 0)
    return of >= FEWEST_OTHERS and found >= AGAIN * of


def _limits(mode: Mode) -> Iterator[tuple[str, float, float, float]]:
    """Code, value, and the limits above which it makes a mode doubtful and rejected."""
    never, again = float("inf"), is_found_again(mode)
    share = (mode.misfit_share or 0.0) if (mode.misfit or 1.0) > MISFIT else 0.0
    if again or mode.half_power_damping is not None or mode.misfit is None:
        yield "misfit", share, REJECTED_SHARE, REJECTED_SHARE
        yield "heavy-damping", mode.damping_ratio, HEAVY_DAMPING, HEAVY_DAMPING
    else:
        yield "misfit", share, MISFIT_SHARE, REJECTED_WITHOUT_PEAK
        yield "heavy-damping", mode.damping_ratio, DOUBTFUL_DAMPING, REJECTED_DAMPING
    largest = REJECTED_ERROR_AGAIN if again else REJECTED_ERROR
    is_turned = abs(mode.phase_deg) > TURNED and not again
    yield "uncertain", relative_error(mode), WELL_KNOWN if is_turned else largest, largest
    if mode.coherence is not None:
        yield "low-coherence", 1 - mode.coherence, 1 - LEAST_COHERENCE, never
    if mode.edge_distance is not None:
        yield "cut-by-edge", 1 - mode.edge_distance, 0.0, 1.0
    yield "still-ringing", mode.left_ringing or 0.0, MOST_LEFT, never


def relative_error(mode: Mode) -> float:
    """The larger of the relative standard errors of damping ratio and stiffness (-), of what is known; 0 where not
    estimated."""
    if mode.best_covariance is None:
        return 0.0
    _, damping, stiffness = mode.standard_error
    shares = float(damping) / mode.damping_ratio, float(stiffness) / abs(mode.stiffness)
    return max(shares) if mode.has_stiffness else shares[0]
