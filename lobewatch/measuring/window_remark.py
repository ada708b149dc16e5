"""An exponential window that nobody named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from acquisition import Hit, Remark, hidden_window
from modal import Mode, Trust, common_decay, trust_of


def about_hidden_window(hits: Sequence[Hit], modes: Sequence[Mode]) -> Iterator[Remark]:
    """Remark on an exponential window that nobody named: the hits show it, or without any the modes, all of which then
    decay alike."""
    trusted = [mode for mode in modes if trust_of(mode) is Trust.TRUSTED]
    if hits:
        tau, sign = hidden_window(hits), "the noise at the end of the records is lower than before the hits"
    else:
        rate, sign = common_decay(trusted), "all modes decay alike, damping falls as 1/f"
        tau = None if rate is None else 1 / rate
    if tau is not None:
        lost = "damping is too large, and stiffness by what it had lost by the hit"
        text = f"{sign}, as under an exponential window of {tau:.2g} s: {lost}"
        yield Remark("window-suspected", "", text, "look it up, and name it with --window, or export without")
