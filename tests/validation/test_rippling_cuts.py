"""Ripple, ribs and corners in simulated cuts: no chatter where there is none, and told where it is."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from rippling_milling import RipplingCut, draw_cuts, mill

from acquisition.emulation import make_random_housing, sample_housing
from lobewatch.cuts.chatter_detection.cut_evaluation import CutRecording, evaluate_recording

CUTS = 4
"""Cuts of each kind; the study of docs/studies/cuts.md has 60 of each."""
SHORT = 0.5
"""Length of short chatter in a cut of 8 s (s)."""
MAX_MISSED_SHARE = 0.25
"""Largest share of chattering cuts that are not told, for so few cuts; chosen."""


def draw(kind: str, seed: int, count: int) -> list[RipplingCut]:
    """Draw cuts that are stable, chatter, or chatter for half a second anywhere."""
    if kind != "short":
        return list(draw_cuts(seed, count, kind == "chatter"))
    random = np.random.default_rng(seed)
    begins = random.uniform(0.3, 7.1, count)
    cuts = zip(draw_cuts(seed, count, True, (7.9, 8.0)), begins, strict=True)
    return [
        replace(cut, first=begin, last=begin + SHORT, kind="sine", loudness=min(cut.loudness, 0.2))
        for cut, begin in cuts
    ]


def count_verdicts(kind: str, seed: int, count: int) -> Counter[str]:
    """Count the verdicts on simulated cuts that do in the simulation as they should."""
    cuts, words = draw(kind, seed, count), Counter[str]()
    for i, milled in mill(cuts):
        if milled.chatters is (kind != "stable"):
            random, cut = np.random.default_rng((seed, i)), cuts[i]
            housing = make_random_housing(random, cut.speed_rpm)
            signal = sample_housing(milled.motion, housing, cut.speed_rpm, 25600.0, random)
            heard = evaluate_recording(CutRecording(signal, 25600.0, cut.cut.teeth, cut.cut.immersion, cut.speed_rpm))
            verdicts = {"chatter" if sound.chatter else sound.reason or sound.verdict for sound in heard}
            words["chatter" if "chatter" in verdicts else min(verdicts)] += 1
    return words


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", ["stable", "chatter", "short"])
def test_ripple_is_no_chatter_and_hides_none(kind: str) -> None:
    words = count_verdicts(kind, 2611, CUTS)
    assert sum(words.values()) > 0
    if kind == "stable":
        assert words["chatter"] == 0
    else:
        assert words["stable"] == 0
        assert words["chatter"] >= (1 - MAX_MISSED_SHARE) * sum(words.values())


if __name__ == "__main__":
    for each in ("stable", "chatter", "short"):
        sys.stdout.write(f"{each}: {dict(count_verdicts(each, int(sys.argv[1]), int(sys.argv[2])))}\n")
