"""The verdict on one hit in flags alone."""

from __future__ import annotations

from acquisition.hit import Hit, HitFlags
from acquisition.verdicts.judge_hit import judge_hit


def check_hit(hit: Hit) -> HitFlags:
    """All that is wrong with a hit, from its time signals alone; falsy when it may be averaged. See `judge_hit`."""
    return judge_hit(hit).flags
