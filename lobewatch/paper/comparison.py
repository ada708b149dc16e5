"""Comparison of numbers of the paper with ours, and of its claims with the evidence."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Comparison:
    """Number of the paper compared with ours."""

    quantity: str
    """Name of the quantity."""
    where: str
    """Number of an equation or a figure in the paper; empty for numbers in the text, or for our own."""
    printed: float | None
    """Value in the paper, in `unit`; None if none is printed."""
    ours: float
    """Computed value, in `unit`; nan if there is none."""
    unit: str
    """Unit of both; empty for a count, "-" for a ratio."""
    digits: int
    """Number of significant digits shown of ours."""
    reason: str
    """Reason of the difference; for our own number, its meaning."""

    @property
    def difference(self) -> float | None:
        """Relative difference of ours; None if nothing is printed."""
        return self.ours / self.printed - 1 if self.printed else None


@dataclass(frozen=True)
class Claim:
    """Claim of the paper, and whether it holds on the surrogate."""

    text: str
    """Claim in our words."""
    verdict: str
    """Verdict: holds, holds in part, fails."""
    evidence: str
    """Computed evidence."""


@dataclass(frozen=True)
class NumberGroup:
    """Group of related numbers."""

    title: str
    """Headline, with the figures and equations of the paper."""
    figures: tuple[str, ...]
    """Names of the figures of the group."""
    comparisons: tuple[Comparison, ...]
    """Numbers, in the order of the paper."""


def format_share(share: float, sign: str = "") -> str:
    """Format a share in percent, a small one by a power of ten; with "+" as sign also a positive one."""
    if abs(share) >= 1e-4:
        return f"{100 * share:{sign}.3g} %"
    return f"{share:{sign}.1e}".replace("e-0", "e-")
