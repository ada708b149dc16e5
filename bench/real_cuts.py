"""Public recordings of real cuts: how many are found, told, and told wrong.

    python bench/real_cuts.py FOLDER

Nothing is fetched: FOLDER holds copies of the public repositories, each as FOLDER/OWNER/NAME; what is not there is
skipped. Prints the tables of docs/cuts.md. Nobody has labelled these cuts: the speed is that of a plain comb where one
stands clear of noise, axes of one sensor hear one spindle, a word on a harmonic is false, and so is any word on air.
"""

from __future__ import annotations

import re
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from acquisition import Description
from acquisition.files.read_recording import NOTHING
from acquisition.files.read_sound import read_sound
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.cuts.listening.judge_cut import HeardSound
from lobewatch.cuts.listening.listen_to import CutRecording, listen_to
from lobewatch.cuts.listening.spectrum import Spectrum, spectrum_of

Floats = NDArray[np.float64]

PIECE = 0.25
"""Length of the pieces by whose level the judge finds a cut (s)."""
LOUD = 0.8
"""Quantile of the level that is taken to be a cut."""
WINDOW = 2.0
"""Length of a window of air, and of the middle of a cut that was not found (s)."""
AROUND, HARMONICS = 0.05, 16
"""Relative distance up to which the comb is looked for, and its highest multiple."""
SCATTER, SIGMAS = 0.56, 5.0
"""Standard deviation of log10 of the power of noise in one bin, and how many of its mean a clear comb is above it."""
NEIGHBOURS = 129
"""Bins from which the local median of the power is taken."""
SAME_SPEED = 1e-3
"""Relative difference up to which two speeds are one."""
ON_HARMONIC = 0.02
"""Orders from a multiple of a clear comb within which chatter is false."""
NOT_FOUND = ("no-cut", "no-air", "too-short")
"""Reasons that say that no one cut was found."""


@dataclass(frozen=True)
class Source:
    """Recordings that were made alike."""

    title: str
    pattern: str
    """Paths below FOLDER."""
    columns: tuple[str, ...]
    """What its columns are, in their order: "*" for each axis in turn, else as in --columns."""
    teeth: int
    immersion: float = 1.0
    rpm: float = 0.0
    """Speed as set; 0 where it stands in the path."""
    options: Description = NOTHING
    """What the files do not say."""


CUTS = "Yang51st/Machining-Chatter-Detection-Program/VibrationData"
MACHINE = f"{CUTS}/HurcoVMX42SRTi"
THREE = ("time [s]", "*", "*", "*", "-")
SOUND = "hafeztrimukti29/chatter-detection-using-accoustic-approach-and-once-per-revolution-variance"
LABELLED = "mhrahimi/Real-time-chatter-detection-using-AutoML-CNN"
MICROPHONE = Description(unit="m/s^2", full_scale=(1.0, 1.0))
SOURCES = (
    Source("4140 steel, table", f"{MACHINE}/4140SteelCutsAlongX/EBI_*.csv", THREE, 4),
    Source("aluminium, table", f"{MACHINE}/AluminumCutsAlongX/EBI_*.csv", THREE, 3),
    Source("steel along x, table or vice", f"{MACHINE}/CutsAlongX/EBI_*.csv", THREE, 4),
    Source("steel, ramp", f"{MACHINE}/CutsAlongXYZ/EBI_*.csv", THREE, 4),
    Source("steel, plunge", f"{MACHINE}/CutsAlongZ/EBI_*.csv", THREE, 4),
    Source("two sensors, first", f"{MACHINE}/CutsAlongX/SKF_Test/EBI_*.csv", THREE[:4], 4),
    Source("two sensors, second", f"{MACHINE}/CutsAlongX/SKF_Test/SKF_*.csv", THREE[:3], 4),
    Source("labelled chatter", f"{LABELLED}/+echd/testUnit/data.mat", ("*",), 4, rpm=5000.0,
           options=Description(rate=10000.0, unit="m/s^2")),
    Source("microphone, stable", f"{SOUND}/Stable.wav", ("*", "*"), 6, rpm=4490.0, options=MICROPHONE),
    Source("microphone, chatter", f"{SOUND}/Chatter.wav", ("*", "*"), 6, rpm=1656.0, options=MICROPHONE),
)  # fmt: skip
AIR = (
    Source("air cut", f"{MACHINE}/CutsAlongX/PCB_*AirCut.csv", ("time [s]", "*", "*", "-", "-", "-", "-", "-"), 4),
    Source("idle, microphone", f"{SOUND}/Idle Sound.wav", ("*", "*"), 6, rpm=4490.0, options=MICROPHONE),
)


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis of one file."""

    path: Path
    signal: Floats
    rate: float
    rpm: float
    source: Source

    def heard(self, signal: Floats) -> list[HeardSound]:
        """What is told of it, or of a part."""
        return listen_to(CutRecording(signal, self.rate, self.source.teeth, self.source.immersion, self.rpm))


@dataclass(frozen=True)
class Comb:
    """A plain comb: mean of log10 of power over its local median at the multiples of a frequency."""

    frequency: float
    score: float
    limit: float
    """Score that noise does not reach."""

    @property
    def is_clear(self) -> bool:
        """Whether the speed is known by it."""
        return self.score > self.limit


@dataclass
class Tally:
    """What was told of one source."""

    cuts: int = 0
    found: int = 0
    speeds: Counter[str] = field(default_factory=Counter)
    words: Counter[str] = field(default_factory=Counter)
    pairs: int = 0
    apart: int = 0
    on_harmonic: int = 0


def axes_of(folder: Path, source: Source) -> Iterator[list[Axis]]:
    """The axes of each file."""
    for path in sorted(folder.glob(source.pattern)):
        speed = source.rpm or float((re.findall(r"(\d+)RPM", path.name) or re.findall(r"(\d+)RPM", str(path)))[0])
        yield [
            Axis(path, sound.acceleration, sound.sample_rate, speed, source)
            for sound in (read_sound(path, said) for said in _descriptions(source))
        ]


def _descriptions(source: Source) -> Iterator[Description]:
    """One for each axis."""
    places = [place for place, column in enumerate(source.columns) if column == "*"]
    for number, place in enumerate(places, 1):
        if source.options != NOTHING:
            response = number if len(places) > 1 else None
            yield Description(**vars(source.options) | {"response": response})
        else:
            kept = [
                "acceleration [m/s^2]" if i == place else "-" if c == "*" else c for i, c in enumerate(source.columns)
            ]
            yield Description(columns=tuple(kept))


def loud_part(signal: Floats, rate: float) -> tuple[int, int]:
    """The longest part above the middle, in log, between the quietest piece and a loud one, by the level alone."""
    size = round(PIECE * rate)
    pieces = signal[: signal.size // size * size].reshape(-1, size)
    level = np.log10(np.std(pieces, axis=1) + np.finfo(np.float64).tiny)
    edge = np.diff(np.r_[0, (level > (np.min(level) + np.quantile(level, LOUD)) / 2).astype(int), 0])
    begin, end = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    longest = int(np.argmax(end - begin))
    return int(begin[longest]) * size, int(end[longest]) * size


def comb_in(spectrum: Spectrum, frequency: float) -> Comb:
    """The best comb near a frequency (Hz)."""
    power = np.log10(spectrum.power + np.finfo(np.float64).tiny)
    above = power - median_filter(power, NEIGHBOURS)
    highest = int(min(HARMONICS, spectrum.frequency[-1] / frequency / (1 + AROUND)))
    grid = np.arange(1 - AROUND, 1 + AROUND, spectrum.bin / (4 * HARMONICS * frequency)) * frequency
    score = np.mean([np.interp(k * grid, spectrum.frequency, above) for k in range(1, highest + 1)], axis=0)
    best = int(np.argmax(score))
    is_inside = 0 < best < grid.size - 1
    limit = SIGMAS * SCATTER / np.sqrt(highest)
    return Comb(float(grid[best]), float(score[best]) if is_inside else 0.0, float(limit))


def comb_of(axis: Axis, heard: HeardSound) -> Comb:
    """Of the part that was listened to, else of the middle of what is loud."""
    part = heard.parts.cut
    if part.stop == part.start:
        begin, end = loud_part(axis.signal, axis.rate)
        half = min(round(WINDOW * axis.rate), end - begin) // 2
        part = slice((begin + end) // 2 - half, (begin + end) // 2 + half)
    return comb_in(spectrum_of(axis.signal[part], axis.rate), axis.rpm / 60)


def judge_file(axes: list[Axis], tally: Tally) -> None:
    """All that is to be counted of the axes of a file."""
    speeds = []
    for axis in axes:
        cuts = axis.heard(axis.signal)
        heard = max(cuts, key=lambda cut: cut.parts.end - cut.parts.begin)
        comb = comb_of(axis, heard)
        tally.cuts += 1
        tally.found += len(cuts) == 1 and heard.reason not in NOT_FOUND
        tally.words[heard.word if heard.word != "cannot tell" else heard.reason] += 1
        tally.speeds[_speed_word(heard, comb)] += 1
        tally.on_harmonic += comb.is_clear and _is_on_harmonic(heard, comb.frequency)
        speeds.append(heard.speed_rpm)
    pairs = [pair for pair in combinations(speeds, 2) if np.all(np.isfinite(pair))]
    tally.pairs += len(pairs)
    tally.apart += sum(abs(one / other - 1) > SAME_SPEED for one, other in pairs)


def _speed_word(heard: HeardSound, comb: Comb) -> str:
    if not comb.is_clear:
        return "unclear"
    if np.isnan(heard.speed_rpm):
        return "silent"
    return "right" if abs(heard.speed_rpm / 60 / comb.frequency - 1) < SAME_SPEED else "wrong"


def _is_on_harmonic(heard: HeardSound, turn: float) -> bool:
    """Whether chatter is said at a multiple of a turn (Hz)."""
    if heard.chatter is None or heard.word != "chatter":
        return False
    return bool(fold_frequency(heard.chatter.frequency, turn) < ON_HARMONIC * turn)


def air_windows(axis: Axis, only_air: bool) -> Iterator[Floats]:
    """Windows without a cut: of a recording of air, else of what stands before and after what is loud."""
    size = round(WINDOW * axis.rate)
    begin, end = (axis.signal.size, axis.signal.size) if only_air else loud_part(axis.signal, axis.rate)
    spare = round(2 * PIECE * axis.rate)
    for first, last in ((0, begin - spare * (not only_air)), (end + spare, axis.signal.size)):
        for place in range(first, last - size + 1, size):
            yield axis.signal[place : place + size]


def words_on_air(axes: list[Axis], only_air: bool) -> Iterator[str]:
    """The words on each window without a cut, on the first axis."""
    for window in air_windows(axes[0], only_air):
        yield from (heard.word for heard in axes[0].heard(window))


def row(source: Source, tally: Tally) -> str:
    """Of the table."""
    speeds, words = tally.speeds, tally.words
    clear = speeds["right"] + speeds["wrong"] + speeds["silent"]
    told = ", ".join(f"{count} {word}" for word, count in words.most_common())
    return (
        f"| {source.title} | {tally.found} of {tally.cuts} | {speeds['right']}, {speeds['wrong']}, {speeds['silent']} "
        f"of {clear} | {tally.apart} of {tally.pairs} | {told} | {tally.on_harmonic} | "
    )


def main() -> None:
    """Print the tables."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("give the folder of the public recordings: python bench/real_cuts.py FOLDER")
    folder, began, air = Path(sys.argv[1]), time.process_time(), Counter[str]()
    print("| recordings | cut found | speed right, wrong, silent | axes apart | words and reasons | false words |")
    print("|---|---|---|---|---|---|")
    for source in SOURCES:
        tally = Tally()
        for axes in axes_of(folder, source):
            judge_file(axes, tally)
            air.update(words_on_air(axes, only_air=False))
        if tally.cuts:
            print(row(source, tally), flush=True)
    for source in AIR:
        for axes in axes_of(folder, source):
            air.update(words_on_air(axes, only_air=True))
    print(f"\nwindows of air: {dict(air)}; {time.process_time() - began:.0f} s of CPU")


if __name__ == "__main__":
    main()
