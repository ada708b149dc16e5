"""Which modes may be followed, calibrated and used for lobes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Remark, stiffness_doubt
from modal.mode import Mode

MOST_DAMPING = float(np.sin(np.pi / 8))
"""Damping ratio from which on the receptance falls to 1/sqrt(2) of its peak on one side only: 2 zeta sqrt(1 - zeta^2)
is 1/sqrt(2) there. The pole of a drift behind a high-pass filter (0.5 and more) is above it, a machine tool far below.
"""


@dataclass(frozen=True, eq=False)
class Believed:
    """The modes of one FRF, those that may be believed apart from the others."""

    modes: tuple[Mode, ...]
    """Those that may be followed, calibrated and used for lobes; the first ones come first."""
    others: tuple[Mode, ...]
    """The rest."""
    remarks: tuple[Remark, ...]
    """One about each of the rest, with the reason."""


def believed(modes: Sequence[Mode]) -> Believed:
    """Sort out drift, peaks cut by the edge of the lines, stiffness of no machine, and what is no driving point."""
    reasons = [(mode, _reason(mode)) for mode in modes]
    others = [(mode, reason) for mode, reason in reasons if reason]
    return Believed(
        tuple(mode for mode, reason in reasons if not reason),
        tuple(mode for mode, _ in others),
        tuple(_remark(mode, reason) for mode, reason in others),
    )


def _reason(mode: Mode) -> str:
    """Why a mode is not believed; empty where it is."""
    if mode.damping_ratio >= MOST_DAMPING:
        return f"zeta {100 * mode.damping_ratio:.0f} %: it has no peak of its own, as a drift has none"
    if any(remark.code == "cut-by-edge" for remark in mode.remarks):
        return "its peak is cut by the edge of the lines"
    doubt = stiffness_doubt(mode.stiffness)
    if doubt is not None:
        return doubt.text
    return "" if mode.is_driving_point else "no driving point, its K is negative"


def _remark(mode: Mode, reason: str) -> Remark:
    cure = "look at the picture (lobewatch modes --figure); a drift goes with another cable or a longer rest"
    return Remark("mode-not-believed", f"{mode.frequency:.4g} Hz", f"not followed, not used for lobes: {reason}", cure)
