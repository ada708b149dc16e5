"""Save the cross tap test that the hits of a tap test with two accelerometers give."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import acquisition
from acquisition import CROSS_TAP, Hit, HitFlags, TapTest, evaluate_hit
from acquisition.errors import format_os_error
from acquisition.tap_test import decide_flags
from lobewatch.tap.tap_in_progress import TapInProgress, average_hits, evaluate_safely

MIN_CROSS_TAP_HITS = 3
"""Good hits needed for a cross FRF, chosen: fewer do not show their scatter."""


class CrossTapResult(NamedTuple):
    """Result of the cross tap test that the same hits give."""

    tap_id: str | None
    """Id of the saved tap test, None if it was not saved."""
    text: str
    """Sentence for the operator."""


def commit_cross_tap(tap: TapInProgress, commit: Callable[[TapTest], None]) -> CrossTapResult | None:
    """Save the cross tap test of a finished test of a driving point. None if no second sensor recorded it.

    It uses the hits that are good at the driving point and in the second sensor. A failure is reported and does not
    affect the other test.
    """
    numbers = [i for i, hit in enumerate(tap.hits) if hit.cross_hit is not None]
    if not numbers:
        return None
    hits = [cross for hit in tap.hits if (cross := hit.cross_hit) is not None]
    first = [tap.decided_flags[i] for i in numbers]
    found = [
        tap.flags[i] | (HitFlags.OK if tap.decided_flags[i] else _evaluate_cross_hit(hit))
        for i, hit in zip(numbers, hits, strict=True)
    ]
    decisions = tuple(
        replace(made, hit=numbers.index(made.hit - 1) + 1) for made in tap.decisions if made.hit - 1 in numbers
    )
    verdicts = decide_flags(found, decisions)
    good, wanted = verdicts.count(HitFlags.OK), first.count(HitFlags.OK)
    faults = {flags.words for flags, before in zip(verdicts, first, strict=True) if flags and not before}
    used = f"{good} of the {wanted} hits in x ({', '.join(sorted(faults))} in y)" if faults else f"the {good} hits in x"
    about = replace(tap.circumstances, direction=CROSS_TAP)
    try:
        if good < MIN_CROSS_TAP_HITS:
            raise ValueError(f"only {used} are usable. Check the sensor along y.")
        test = average_hits(acquisition.new_tap_id(about), about, hits, found, decisions)
        commit(test)
    except (ArithmeticError, OSError, ValueError) as error:
        why = format_os_error(error) if isinstance(error, OSError) else str(error)
        return CrossTapResult(None, f"{CROSS_TAP} is not saved: {why.rstrip('.')}.")
    return CrossTapResult(test.id, f"{CROSS_TAP} is also saved, from {used}.")


def _evaluate_cross_hit(hit: Hit) -> HitFlags:
    """Return the faults of a hit as the second sensor recorded it, which may hardly respond."""
    if np.ptp(hit.acceleration) == 0:
        return HitFlags.NOT_EVALUATED
    return evaluate_safely(lambda: evaluate_hit(hit)).flags & ~HitFlags.NO_RESPONSE
