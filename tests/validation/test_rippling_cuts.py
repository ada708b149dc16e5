"""Ripple, ribs and corners in simulated cuts: no chatter where there is none, and told where it is."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from rippling_milling import draw_cuts, mill

from acquisition.emulation import make_random_housing, sample_housing
from lobewatch.cuts.chatter_detection.cut_evaluation import CutRecording, evaluate_recording

CUTS = 4
"""Cuts of each kind; the study of docs/studies/cuts.md has 90."""


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("chatters", [False, True])
def test_ripple_is_no_chatter_and_hides_none(chatters: bool) -> None:
    cuts, words = list(draw_cuts(2611, CUTS, chatters)), Counter[str]()
    for i, milled in mill(cuts):
        if milled.chatters is chatters:
            random, cut = np.random.default_rng((2611, i)), cuts[i]
            housing = make_random_housing(random, cut.speed_rpm)
            signal = sample_housing(milled.motion, housing, cut.speed_rpm, 25600.0, random)
            heard = evaluate_recording(CutRecording(signal, 25600.0, cut.cut.teeth, cut.cut.immersion, cut.speed_rpm))
            words.update({"chatter" if sound.chatter else sound.verdict for sound in heard})
    assert words["chatter"] >= sum(words.values()) - 1 if chatters else words["chatter"] == 0
