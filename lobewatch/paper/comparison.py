"""One number of the paper beside ours, and one claim beside what was computed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Comparison:
    """A number of the paper beside ours."""

    quantity: str
    """Quantity, in words."""
    where: str
    """Place in the paper: number of an equation or a figure; empty where it is in the text, or ours alone."""
    printed: float | None
    """Value in the paper, in `unit`; None where none is printed."""
    ours: float
    """Value that was computed, in `unit`; nan where there is none."""
    unit: str
    """Unit of both; empty for a number of things, "-" for a ratio."""
    digits: int
    """Digits of ours that are shown: significant ones."""
    reason: str
    """Reason of the difference; of a number that is ours alone, what it says."""

    @property
    def difference(self) -> float | None:
        """Share by which ours is larger; None where nothing is printed."""
        return self.ours / self.printed - 1 if self.printed else None


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, and whether it holds on the surrogate."""

    text: str
    """What is claimed, in our words."""
    verdict: str
    """Word for it: holds, holds in part, fails."""
    evidence: str
    """Evidence that was computed."""


@dataclass(frozen=True)
class NumberGroup:
    """Numbers that belong together."""

    title: str
    """Headline, with the figures and equations of the paper."""
    figures: tuple[str, ...]
    """Names of the figures that show it."""
    comparisons: tuple[Comparison, ...]
    """Numbers, in the order of the paper."""


def format_share(share: float, sign: str = "") -> str:
    """A share in percent, a small one by a power of ten; with "+" as sign also that of a positive one."""
    if abs(share) >= 1e-4:
        return f"{100 * share:{sign}.3g} %"
    return f"{share:{sign}.1e}".replace("e-0", "e-")
