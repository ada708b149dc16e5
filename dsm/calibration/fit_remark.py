"""What a person should know beside a fit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FitRemark:
    """One thing to know. Programs look at `code` and `about`; `text` and `cure` are for people and may be reworded."""

    code: str
    """Kind of remark: words in lower case joined by hyphens, never changed."""
    about: str
    """Groups or modes that it concerns; empty for the whole."""
    text: str
    """Finding, with figures and units, without a full stop."""
    cure: str
    """Advice what to do about it."""

    def __str__(self) -> str:
        """One sentence."""
        return ": ".join(filter(None, (self.about, self.text))) + f"; {self.cure}"
