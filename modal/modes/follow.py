"""The same mode in the next measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Remark
from modal.modes.mac import mac
from modal.modes.mode import Mode

LIKELY_CHANGE = (0.03, 0.5, 0.3)
"""Relative change of frequency, damping ratio and stiffness from one measurement to the next that counts as one."""
LIKELY_MAC_LOSS = 0.1
"""1 - MAC that counts as one."""
FARTHEST = 4.0
"""Distance above which a mode is no longer the same."""
DOUBTFUL = 2.5
"""Distance above which it may be another one."""
MOST_MOVED = 0.15
"""Relative change of the frequency up to which a mode is the same where nothing else may be another one's."""
RIVAL = 2.0
"""A second mode that is less than this many times as far may be the one, too."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The mode that continues an earlier one."""

    mode: Mode | None
    """Mode that continues it; None where no mode is near enough."""
    remarks: tuple[Remark, ...]
    """Reasons why it may be another mode, or why there is none; empty where it is clear."""


def follow(last: Mode, modes: Sequence[Mode]) -> Followed:
    """Of modes (driving points) the one that is most like the last one followed, with a remark where that is not clear.

    The distance is the root of the sum of squares of the changes of frequency, damping ratio and stiffness, each
    in units of a likely change (of the stiffness where both know it), and of 1 - MAC where both modes have shapes over
    the same points. A mode that is alike
    but for its frequency is the same up to 15 %, the fall of a spindle that must be seen.

    >>> last = Mode(700.0, 0.03, 2e7)
    >>> now = [Mode(650.0, 0.03, 1.8e7), Mode(905.0, 0.02, 6e7)]
    >>> follow(last, now).mode.frequency  # Hz
    650.0
    >>> follow(last, now[1:]).mode is None
    True
    """
    near = sorted((m for m in modes if m.is_driving_point), key=lambda mode: _distance(last, mode))
    if not near or not _is_same(last, near[0]):
        nearest = f" (nearest is {near[0].frequency:.1f} Hz)" if near else ""
        text = f"no mode to follow, none is like this one{nearest}"
        return Followed(None, (Remark("no-mode-to-follow", f"{last.frequency:.0f} Hz", text),))
    first, about = _distance(last, near[0]), f"{near[0].frequency:.0f} Hz"
    if len(near) > 1 and _distance(last, near[1]) < RIVAL * max(first, 0.5):
        text = f"followed mode in doubt: {near[1].frequency:.1f} Hz is nearly as like {_values(last)}"
        return Followed(near[0], (Remark("rival-mode", about, text),))
    if first > DOUBTFUL:
        text = f"followed mode in doubt: it was {_values(last)}, now {_values(near[0])}"
        return Followed(near[0], (Remark("large-change", about, text),))
    return Followed(near[0], ())


def _is_same(last: Mode, mode: Mode) -> bool:
    if _distance(last, mode) <= FARTHEST:
        return True
    moved = abs(mode.frequency / last.frequency - 1) <= MOST_MOVED
    return moved and _distance(replace(last, frequency=mode.frequency), mode) <= DOUBTFUL


def _values(mode: Mode) -> str:
    return f"{mode.frequency:.1f} Hz" + (f" with {mode.stiffness / 1e6:.3g} N/um" if mode.has_stiffness else "")


def _distance(a: Mode, b: Mode) -> float:
    ratios = (b.frequency / a.frequency, b.damping_ratio / a.damping_ratio, b.stiffness / a.stiffness)
    known = 3 if a.has_stiffness and b.has_stiffness else 2
    pairs = list(zip(ratios, LIKELY_CHANGE, strict=True))[:known]
    changes = [np.log(ratio) / likely if ratio > 0 else np.inf for ratio, likely in pairs]
    if a.shape is not None and b.shape is not None and a.shape.shape == b.shape.shape:
        changes.append((1 - mac(a.shape, b.shape)) / LIKELY_MAC_LOSS)
    return float(np.linalg.norm(changes))
