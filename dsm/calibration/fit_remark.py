"""What a person should know beside a fit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FitRemark:
    """One thing to know. Programs look at `code` and `about`; `text` and `cure` are for people and may be reworded."""

    code: str
    """What kind of remark it is: words in lower case joined by hyphens, never changed."""
    about: str
    """The groups or modes that it concerns; empty for the whole."""
    text: str
    """What is so, with figures and units, without a full stop."""
    cure: str
    """What to do about it."""

    def __str__(self) -> str:
        """One sentence."""
        return ": ".join(filter(None, (self.about, self.text))) + f"; {self.cure}"
