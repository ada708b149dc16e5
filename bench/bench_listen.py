"""CPU time of `listen` for 10 s at 25.6 kHz, compared with scipy's Welch spectrum in the same run.

.venv/bin/python bench/bench_listen.py
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from race import Race
from scipy.signal import welch
from threadpoolctl import threadpool_limits

from acquisition.emulation import MillingCut, Passage, Structure, make_random_housing, sample_housing, simulate_cuts
from lobewatch.cuts.chatter_detection.cut_evaluation import CutRecording, evaluate_recording

Floats = NDArray[np.float64]
RATE, SECONDS, ROUNDS = 25600.0, 10.0, 5
"""Sample rate (Hz), length of a recording (s), and times that each is judged; the median counts."""
TEETH, SPEED, SET = 4, 5200.0, 5220.0
"""Teeth of the cutter, its speed and the speed that is set (rpm)."""
X, Y = (Structure(*np.array(mode)) for mode in ([[603.0], [0.039], [5.59e6]], [[666.0], [0.035], [5.715e6]]))
"""Tip of the Altintas & Budak benchmark."""
DEPTHS = {"stable": 0.4e-3, "chatter": 1.4e-3}
"""Axial depths of half a slot (m) that are, and are not, stable."""
SAMPLES = 8192
"""Length of the pieces of the peer."""


def recordings() -> Iterator[tuple[str, Floats, float]]:
    """Yield name, signals of one to three axes, shape (axes, n), and commanded speed (rpm)."""
    whole, short = Passage(2.0, 0.05, 7.0, 0.95), Passage(0.4, 0.05, 0.8, 0.1)
    for (word, _), axes in zip(DEPTHS.items(), sounds(whole), strict=True):
        yield f"one cut, {word}", axes[:1], SET
        yield f"one cut, {word}, three axes", axes, SET
        yield f"one cut, {word}, three axes, speed set 25 % too low", axes, 0.75 * SPEED
    parts = [axes[:1] for axes in sounds(short)]
    seven = np.concatenate([parts[number % 2] for number in range(7)], axis=1)
    yield "seven cuts", np.pad(seven, ((0, 0), (0, round(SECONDS * RATE) - seven.shape[1])), mode="wrap"), SET


def sounds(passage: Passage) -> list[Floats]:
    """Three axes of a housing in a passage through each of `DEPTHS`."""
    cuts = [MillingCut(TEETH, 0.0, np.pi / 2, 6e8, 2e8, depth, 1e-4, SPEED, X, Y) for depth in DEPTHS.values()]
    random, heard = np.random.default_rng(0), dict[int, Floats]()
    housings = [make_random_housing(random, SPEED) for _ in range(3)]
    for place, motion in simulate_cuts(cuts, passage):
        heard[place] = np.stack([sample_housing(motion, housing, SPEED, RATE, random) for housing in housings])
    return [heard[place] for place in sorted(heard)]


def seconds(work: Callable[[], object]) -> float:
    """Median CPU time of a few rounds (s)."""
    times = [time.process_time()]
    for _ in range(ROUNDS):
        work()
        times.append(time.process_time())
    return float(np.median([after - before for before, after in pairwise(times)]))


def races() -> Iterator[Race]:
    """Compare with Welch's spectrum."""
    for name, axes, speed in recordings():
        if name in ("one cut, chatter, three axes", "seven cuts"):
            yield Race(
                f"chatter detection, {SECONDS:g} s: {name}",
                partial(evaluate_recording, CutRecording(axes, RATE, TEETH, 0.5, speed)),
                "scipy, Welch spectrum only",
                partial(welch, axes, RATE, nperseg=SAMPLES),
            )


def main() -> None:
    """Print the table."""
    print("| recording | cuts told | CPU (s) | Welch's spectrum (s) | ratio |\n" + "|---" * 5 + "|")
    for name, axes, speed in recordings():
        recording = CutRecording(axes, RATE, TEETH, 0.5, speed)
        told = [sound.verdict for sound in evaluate_recording(recording)]
        words = ", ".join(f"{told.count(word)} {word}" for word in dict.fromkeys(told))
        ours, peer = seconds(lambda: evaluate_recording(recording)), seconds(lambda: welch(axes, RATE, nperseg=SAMPLES))  # noqa: B023
        print(f"| {name} | {words} | {ours:.3f} | {peer:.3f} | {ours / peer:.0f} |", flush=True)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
