"""Cutters of unequal pitch are heard by the orders of the spindle, not by tooth passing alone."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.emulation import MillingCut, Passage, Structure, simulate_cut
from lobes import Cut
from lobewatch.cuts.listening.listen_to import CutRecording, listen_to

X, Y = Structure(*np.array([[603.0], [0.039], [5.59e6]])), Structure(*np.array([[666.0], [0.035], [5.715e6]]))


@pytest.mark.parametrize(
    ("pitch", "speed", "depth", "word"),
    [
        ((80, 100, 80, 100), 6600.0, 0.9e-3, "chatter"),
        ((75, 85, 95, 105), 5200.0, 1.1e-3, "stable"),
        ((75, 85, 95, 105), 5200.0, 1.4e-3, "chatter"),
    ],
)
def test_the_comb_of_the_spindle_is_no_chatter(pitch: tuple[float, ...], speed: float, depth: float, word: str) -> None:
    cut = Cut(4, 1.0, "down", 6e8, 2e8, pitch=tuple(np.radians(pitch)))
    motion = simulate_cut(
        MillingCut(4, cut.entry_angle, cut.exit_angle, 6e8, 2e8, depth, 1e-4, speed, X, Y, pitch=cut.pitch),
        Passage(before=0.4, ramp=0.02, steady=0.6, after=0.1),
    )
    signal = motion.acceleration[:, ::3]
    signal = signal + 0.3 * np.random.default_rng(1).normal(size=signal.shape)
    (heard,) = listen_to(CutRecording(signal, motion.sample_rate / 3, cut.repeats, cut.immersion, speed * 1.004))
    assert heard.word == word
    assert heard.speed_rpm == pytest.approx(speed, rel=1e-3)
