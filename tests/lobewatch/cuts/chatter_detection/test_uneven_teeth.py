"""Cutters of unequal pitch, detected by spindle orders and not only by tooth passing."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.emulation import MillingCut, Passage, Structure, simulate_cut
from lobes import Cut
from lobewatch.cuts.chatter_detection.cut_evaluation import CutRecording, evaluate_recording

X, Y = Structure(*np.array([[603.0], [0.039], [5.59e6]])), Structure(*np.array([[666.0], [0.035], [5.715e6]]))


@pytest.mark.parametrize(
    ("pitch", "immersion", "speed", "depth", "word"),
    [
        ((80, 100, 80, 100), 1.0, 6600.0, 0.9e-3, "chatter"),
        ((80, 100, 80, 100), 0.5, 5200.0, 0.8e-3, "stable"),
        ((80, 100, 80, 100), 0.1, 7800.0, 0.4e-3, "stable"),
        ((75, 85, 95, 105), 1.0, 5200.0, 1.1e-3, "stable"),
        ((75, 85, 95, 105), 1.0, 5200.0, 1.4e-3, "chatter"),
    ],
)
def test_the_comb_of_the_spindle_is_no_chatter(
    pitch: tuple[float, ...], immersion: float, speed: float, depth: float, word: str
) -> None:
    cut = Cut(4, immersion, "down", 6e8, 2e8, pitch=tuple(np.radians(pitch)))
    teeth = MillingCut(
        *(4, cut.entry_angle, cut.exit_angle, 6e8, 2e8, depth, 1e-4, speed, X, Y),
        pitch=cut.pitch,
        runout=(0.0, 5e-6, 9e-6, 4e-6),
    )
    motion = simulate_cut(
        teeth,
        Passage(before=0.4, ramp=0.02, steady=0.6, after=0.1),
    )
    signal = motion.acceleration[:, ::3]
    signal = signal + 0.3 * np.random.default_rng(1).normal(size=signal.shape)
    (heard,) = evaluate_recording(
        CutRecording(signal, motion.sample_rate / 3, cut.repeats_per_turn, cut.immersion, speed * 1.004)
    )
    assert heard.verdict == word
    assert heard.speed_rpm == pytest.approx(speed, rel=1e-3)
