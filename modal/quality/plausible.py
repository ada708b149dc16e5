"""Which modes may be followed, calibrated and used for lobes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition import Remark, stiffness_doubt
from modal.modes.mode import Mode
from modal.quality.trust import Trust, trust_rules

REASONS = {
    "heavy-damping": "drift has no peak either",
    "misfit": "the fit leaves too much of it",
    "uncertain": "its damping or stiffness is hardly known",
}
"""Why a mode is rejected, in words, by the rule of `trust_rules`."""
SMALL = 0.1
"""Peak of a mode with negative stiffness over the largest, below which it is left out; chosen."""
CURE = "look at it with lobewatch modes --figure; against drift let the sensor rest longer, or change its cable"


@dataclass(frozen=True, eq=False)
class Believed:
    """The modes of one FRF that may be believed."""

    modes: tuple[Mode, ...]
    """Modes that may be followed, calibrated and used for lobes."""
    against: tuple[Mode, ...]
    """Modes that could be, were their stiffness not negative: no driving point. Small ones are left out."""
    remarks: tuple[Remark, ...]
    """One about each of the rest, with the reason."""


def believed(modes: Sequence[Mode]) -> Believed:
    """Leave out drift, peaks cut by the edge of the lines, stiffness of no machine, and what trust_of rejects.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], np.arange(1.0, 1501.0))
    >>> [round(mode.frequency) for mode in believed(fit_modes(frf)).modes]  # Hz
    [500, 900]
    >>> believed([Mode(500.0, 0.02, 2.0)]).remarks[0].code  # N/um taken for N/m
    'stiffness-not-believed'
    """
    judged = [(mode, _doubt(mode)) for mode in modes]
    plausible = [mode for mode, doubt in judged if doubt is None]
    largest = max((mode.peak for mode in plausible), default=0.0)
    against = [mode for mode in plausible if not mode.is_driving_point]
    small = [mode for mode in against if mode.peak < SMALL * largest]
    return Believed(
        tuple(mode for mode in plausible if mode.is_driving_point),
        tuple(mode for mode in against if mode not in small),
        (*(doubt for _, doubt in judged if doubt is not None), *(_left_out(mode, largest) for mode in small)),
    )


def _left_out(mode: Mode, largest: float) -> Remark:
    text = f"left out: K is negative, its peak {100 * mode.peak / largest:.1g} % of the largest"
    cure = "where it is a mode of the machine, hit and measure at one point in one direction"
    return Remark("small-against", f"{mode.frequency:.4g} Hz", text, cure)


def _doubt(mode: Mode) -> Remark | None:
    """Why a mode is not believed; None where it is."""
    at = f"{mode.frequency:.4g} Hz"
    stiffness = stiffness_doubt(mode.stiffness) if mode.has_stiffness else None
    reasons = [REASONS.get(code, code) for code, verdict in trust_rules(mode) if verdict is Trust.REJECTED]
    if any(remark.code == "cut-by-edge" for remark in mode.remarks):
        reasons.append("its peak is cut by the edge of the lines")
    if reasons:
        text = f"not followed and not used for lobes, damping {100 * mode.damping_ratio:.2g} %: {', '.join(reasons)}"
        return Remark("mode-not-believed", at, text, CURE)
    return None if stiffness is None else Remark(stiffness.code, at, stiffness.text, stiffness.cure)
