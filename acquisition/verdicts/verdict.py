"""The verdict on one hit, with its reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.hit import HitFlags


@dataclass(frozen=True)
class HitVerdict:
    """What is wrong with a hit, and what to do about it."""

    flags: HitFlags
    """Falsy where the hit may be averaged."""
    reasons: tuple[str, ...] = ()
    """One sentence a flag, in the order of the flags: what was found with its figures, and the cure."""

    @classmethod
    def of(cls, findings: Mapping[HitFlags, str]) -> HitVerdict:
        """The verdict that says these findings (what was found, without the cure)."""
        flags = HitFlags.OK
        for flag in findings:
            flags |= flag
        return cls(flags, tuple(f"{findings[flag]}: {flag.cure[0].lower()}{flag.cure[1:]}" for flag in flags))

    @property
    def text(self) -> str:
        """All reasons in one text; empty for a good hit."""
        return " ".join(self.reasons)
