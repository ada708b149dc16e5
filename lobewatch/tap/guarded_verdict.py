"""A verdict whatever happens: one hit on which the judging fails must not end a test."""

from __future__ import annotations

from collections.abc import Callable

from acquisition import HitFlags, HitVerdict


def guarded_verdict(judge: Callable[[], HitVerdict]) -> HitVerdict:
    """What `judge` says of a hit; where it fails, that the hit is refused as NOT_JUDGED, and why it failed."""
    try:
        return judge()
    except Exception as error:  # noqa: BLE001 - whatever it is, the next hit can be good
        return HitVerdict.of({HitFlags.NOT_JUDGED: f"Judging it failed ({type(error).__name__}: {error})"})
