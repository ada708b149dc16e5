"""Recordings of a phone that hold no usable cut: `cannot tell` and why, never chatter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from acquisition.arrays import Floats
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation
from lobewatch.logbook.heard_cuts import FileRequest, hear_signal
from tests.lobewatch.cuts.phone_recordings import RATE, TELEPHONE_RATE, as_signal, draw_cut, play_music, telephone

FEW, MANY = (0, 1), range(2, 42)
"""Seeds of the fast and the long round."""


def hear(sound: Floats, teeth: int, rpm: float, rate: float = RATE) -> CutEvaluation:
    """Return the evaluation of the last cut in a recording, as of a file on the command line."""
    comparisons, _ = hear_signal(as_signal(sound, rate), "cut.wav", FileRequest(teeth, rpm))
    return comparisons[-1].detected


def music(random: np.random.Generator) -> CutEvaluation:
    return hear(play_music(random, 1.0), int(random.integers(2, 5)), random.uniform(3000, 20_000))


def music_from_the_start(random: np.random.Generator) -> CutEvaluation:
    return hear(play_music(random, 0.0), int(random.integers(2, 5)), random.uniform(3000, 20_000))


def silence(random: np.random.Generator) -> CutEvaluation:
    return hear(np.zeros(3 * RATE), int(random.integers(2, 5)), 12_000.0)


def noise_floor(random: np.random.Generator) -> CutEvaluation:
    return hear(1e-3 * random.standard_normal(3 * RATE), 2, 12_000.0)


def clipped(random: np.random.Generator) -> CutEvaluation:
    cut = draw_cut(random, bool(random.integers(2)))
    return hear(np.clip(4 * cut.sound, -1, 1), cut.teeth, cut.rpm)


def speed_off(random: np.random.Generator) -> CutEvaluation:
    cut = draw_cut(random, bool(random.integers(2)))
    return hear(cut.sound, cut.teeth, cut.rpm * random.choice([0.9, 1.1]))


KINDS: dict[str, tuple[Callable[[np.random.Generator], CutEvaluation], set[str]]] = {
    "music": (music, {"speed-not-found", "unexplained-tone", "no-air", "knock", "no-cut", "faint"}),
    "music from the start": (music_from_the_start, {"no-cut", "no-air", "knock", "speed-not-found"}),
    "silence": (silence, {"no-cut"}),
    "noise floor": (noise_floor, {"no-cut", "no-air", "speed-not-found"}),
    "clipped": (clipped, {"overload"}),
    "speed off by 10 %": (speed_off, {"speed-not-found"}),
}
"""Recordings, and the reasons that say why there is no verdict."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seeds", [FEW, pytest.param(MANY, marks=pytest.mark.long)], ids=["few", "many"])
def test_what_is_no_usable_cut_gets_no_verdict(kind: str, seeds: range) -> None:
    make, reasons = KINDS[kind]
    for seed in seeds:
        heard = make(np.random.default_rng(seed))
        assert (heard.verdict, heard.reason in reasons) == ("cannot tell", True), (seed, heard.verdict, heard.reason)


@pytest.mark.parametrize("chatters", [False, True])
@pytest.mark.parametrize("seeds", [FEW, pytest.param(MANY, marks=pytest.mark.long)], ids=["few", "many"])
def test_a_telephone_tells_what_lies_in_its_band(seeds: range, chatters: bool) -> None:
    """Chatter at 400 to 2800 Hz, or three harmonics of tooth passing below 3.4 kHz; else no verdict."""
    told = []
    for seed in seeds:
        random = np.random.default_rng(seed)
        cut = draw_cut(random, chatters)
        heard = hear(telephone(cut.sound), cut.teeth, cut.rpm, TELEPHONE_RATE)
        has_three = 3 * cut.teeth * cut.rpm / 60 < 3400
        if heard.verdict == "cannot tell":
            told.append(not (chatters or has_three))
            continue
        assert heard.verdict == ("chatter" if chatters else "stable"), seed
        assert chatters or has_three, seed
        assert cut.chatter is None or heard.chatter is None or abs(heard.chatter.frequency - cut.chatter) < 2, seed
        told.append(True)
    assert np.mean(told) >= 0.9 or len(told) < 10


@pytest.mark.parametrize("level", [0.3, 1.0])
@pytest.mark.parametrize("seeds", [FEW, pytest.param(MANY, marks=pytest.mark.long)], ids=["few", "many"])
def test_a_second_spindle_that_cuts_at_the_same_time_is_no_chatter(seeds: range, level: float) -> None:
    for seed in seeds:
        random = np.random.default_rng(seed)
        ours, other = draw_cut(random, False), draw_cut(random, False)
        heard = hear(ours.sound + level * other.sound, ours.teeth, ours.rpm)
        assert heard.verdict == "cannot tell", (seed, ours.rpm, other.rpm)
