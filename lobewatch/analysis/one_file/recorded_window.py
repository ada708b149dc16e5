"""The exponential window that a response was recorded with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Hit, time_of_hit


@dataclass(frozen=True)
class Window:
    """exp(-(t - start)/time_constant) from its start on; ValueError for a time constant that is not > 0."""

    time_constant: float
    """(s)."""
    start: float = 0.0
    """When it begins (s from the record's start)."""
    hit_at: float | None = None
    """When the hammer hit (s from the record's start); None to see it in the hits."""

    def __post_init__(self) -> None:
        """Refuse what is no window."""
        if not (np.isfinite(self.time_constant) and self.time_constant > 0):
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
