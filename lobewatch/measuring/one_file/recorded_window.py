"""The exponential window that a response was recorded with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Hit, time_of_hit

SAME = 0.02
"""Relative difference of two time constants that are taken for one."""


@dataclass(frozen=True)
class Window:
    """exp(-(t - start)/time_constant) from its start on; ValueError for a time constant that is not > 0."""

    time_constant: float
    """(s); NaN: as the file names it."""
    start: float = 0.0
    """When it begins (s from the record's start)."""
    hit_at: float | None = None
    """When the hammer hit (s from the record's start); None to see it in the hits."""

    def __post_init__(self) -> None:
        """Refuse what is no window."""
        if not np.isnan(self.time_constant) and not (np.isfinite(self.time_constant) and self.time_constant > 0):
            raise ValueError(f"--window: time_constant={self.time_constant} s is not a finite number > 0")

    def delay(self, hits: Sequence[Hit]) -> float:
        """From its start to the hit (s); ValueError where the hit is not known or comes before it."""
        if self.hit_at is None and not hits:
            raise ValueError(
                f"--window {self.time_constant:g}: an FRF does not say when the hit came, and K is too high by "
                "exp((hit - start)/window); add --hit-at with the seconds from the record's start (the pre-trigger), "
                "0 where the window begins at the hit"
            )
        hit_at = float(np.mean([time_of_hit(hit) for hit in hits])) if self.hit_at is None else self.hit_at
        if not hit_at >= self.start:
            raise ValueError(
                f"--window-start {self.start:g}: the window begins after the hit at {hit_at:.4g} s; "
                "both count from the record's start"
            )
        return hit_at - self.start


def window_over(named: float | None, said: Window | None) -> Window | None:
    """The window to be corrected; named: time constant (s) in the file, NaN where it does not say how its window falls.

    ValueError where neither says it, or both do and differ.
    """
    if named is None and said is not None and np.isnan(said.time_constant):
        raise ValueError("--hit-at, --window-start: the file names no window; add --window with its time constant (s)")
    if named is None:
        return said
    window = Window(named) if said is None else said
    if np.isnan(window.time_constant):
        window = replace(window, time_constant=named)
    if np.isnan(window.time_constant):
        raise ValueError(
            "the response lies under a window, and the file does not say how that falls; give the time constant of an "
            "exponential one with --window, export the file anew where it is another"
        )
    if abs(window.time_constant / named - 1) > SAME:
        raise ValueError(f"--window {window.time_constant:g}: the file says {named:.4g} s; leave the option out")
    return window
