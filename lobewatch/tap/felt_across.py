"""The tap across that the hits of a driving point tell beside it, where a second sensor felt them too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from acquisition import ACROSS, Hit, HitFlags, HitVerdict, TapTest, judge_hit, new_tap_id
from acquisition.errors import system_failure
from lobewatch.tap.guarded_verdict import guarded_verdict
from lobewatch.tap.in_progress import TapInProgress, averaged

FEWEST = 3
"""Good hits that a tap across is made of at least; chosen: with fewer nothing is known of their scatter."""


@dataclass(frozen=True, eq=False)
class FeltAcross:
    """What became of the tap across."""

    tap_id: str | None
    """Identity of the tap test that was saved; None where none was."""
    text: str
    """Sentence on it for the one who tapped."""


def felt_across(tap: TapInProgress, commit: Callable[[TapTest], None]) -> FeltAcross | None:
    """Save the tap across of a finished test of a driving point; None where no second sensor felt it.

    Its hits are those that are good at the driving point and in the second sensor. Whatever goes wrong with it is said
    and costs the other one nothing.
    """
    felt = [(hit.beside, flags) for hit, flags in zip(tap.hits, tap.flags, strict=True) if hit.beside is not None]
    if not felt:
        return None
    hits, firsts = [hit for hit, _ in felt], [flags for _, flags in felt]
    verdicts = [flags or guarded_verdict(partial(_verdict, hit)).flags for hit, flags in felt]
    good, wanted = verdicts.count(HitFlags.OK), firsts.count(HitFlags.OK)
    faults = {flags.words for flags, first in zip(verdicts, firsts, strict=True) if flags and not first}
    part = f"{good} of the same {wanted} hits ({', '.join(sorted(faults))} in y)" if faults else f"the same {good} hits"
    if good < FEWEST:
        return _lost(f"of use are {part}; check the sensor along y")
    about = replace(tap.circumstances, direction=ACROSS)
    try:
        test = averaged(new_tap_id(about), about, hits, verdicts)
        commit(test)
    except (ArithmeticError, OSError, ValueError) as error:
        return _lost(system_failure(error) if isinstance(error, OSError) else str(error))
    return FeltAcross(test.id, f"{ACROSS} is saved too, from {part}.")


def _lost(why: str) -> FeltAcross:
    return FeltAcross(None, f"{ACROSS} is not saved: {why}.")


def _verdict(hit: Hit) -> HitVerdict:
    """Verdict on a hit as the second sensor felt it."""
    return HitVerdict(HitFlags.NOT_JUDGED) if np.ptp(hit.acceleration) == 0 else judge_hit(hit)
