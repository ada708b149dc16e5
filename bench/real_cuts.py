"""Public recordings of real cuts: how many are detected, classified, and misclassified.

    python bench/real_cuts.py FOLDER

FOLDER holds copies of the public repositories, each as FOLDER/OWNER/NAME. Missing ones are skipped. The command prints
the tables of docs/studies/cuts.md. The cuts have no labels. The true speed is that of a clear comb of multiples. All
axes of a sensor have one speed. Chatter on a multiple of the speed and any verdict in air are false.
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
from acquisition.files.read_cut import read_cut_recording
from acquisition.files.read_recording import EMPTY_DESCRIPTION
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency

Floats = NDArray[np.float64]

PIECE = 0.25
"""Length of the pieces by whose level the judge finds a cut (s)."""
LOUD = 0.8
"""Quantile of the level that is taken to be a cut."""
WINDOW = 2.0
"""Length of a window of air, of the reference, and of the middle of a cut that was not found (s)."""
AROUND, HARMONICS = 0.05, 16
"""Relative distance up to which the comb is looked for, and its highest multiple."""
CLEAR = 3.0
"""A comb is clear from so many times the median over all frequencies that are tried."""
PADDED, NEIGHBOURS = 2, 129
"""Zero-padding factor of a part, and number of bins for the local median power."""
SAME_SPEED = 1e-3
"""Relative difference up to which two speeds are one."""
ON_HARMONIC = 0.02
"""Orders from a multiple of a clear comb within which chatter is false."""
COLUMNS = (
    "recordings, cut found, speed of one axis, axes apart, of all axes, words on all axes, not told, both verdicts, "
    "on harmonics"
)
"""Headings of the table."""
NOT_FOUND = ("no-cut", "no-air", "too-short")
"""Reasons that say that no one cut was found."""


@dataclass(frozen=True)
class Source:
    """Recordings that were made alike."""

    title: str
    pattern: str
    """Paths below FOLDER."""
    columns: tuple[str, ...]
    """Columns in order: "*" for each axis in turn, else as in --columns."""
    teeth: int
    immersion: float = 1.0
    rpm: float = 0.0
    """Speed as set; 0 where it stands in the path."""
    options: Description = EMPTY_DESCRIPTION
    """Facts that the files do not state."""


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


@dataclass(frozen=True)
class Comb:
    """A plain comb: mean of log(1 + power over its local median) at the multiples of a frequency."""

    frequency: float
    score: float
    """The mean, over its median at all frequencies that are tried."""

    @property
    def is_clear(self) -> bool:
        """True if the comb determines the speed."""
        return self.score > CLEAR


@dataclass
class Tally:
    """Counts of verdicts for one source."""

    cuts: int = 0
    found: int = 0
    speeds: Counter[str] = field(default_factory=Counter)
    words: Counter[str] = field(default_factory=Counter)
    on_harmonic: int = 0
    pairs: int = 0
    apart: int = 0
    contrary: int = 0
    """Recordings with stable and chattering parts."""

    def add(self, cuts: list[CutEvaluation], comb: Comb) -> None:
        """One more recording."""
        heard = longest(cuts)
        self.cuts += 1
        self.found += len(cuts) == 1 and heard.parts.reason not in NOT_FOUND
        self.words[heard.verdict if heard.verdict != "cannot tell" else heard.reason] += 1
        verdicts = {part.verdict for cut in cuts for part in cut.part_verdicts}
        self.contrary += "stable" in verdicts and bool(verdicts & {"chatter", "flip"})
        self.speeds[_speed_word(heard, comb)] += 1
        self.on_harmonic += comb.is_clear and _is_on_harmonic(heard, comb.frequency)

    @property
    def speed_text(self) -> str:
        """Count right, wrong and missing speeds among the clear ones."""
        right, wrong, silent = (self.speeds[word] for word in ("right", "wrong", "silent"))
        return f"{right}, {wrong}, {silent} of {right + wrong + silent}"


def listened(file: list[Axis], part: slice = slice(None)) -> list[CutEvaluation]:
    """Evaluate some axes together, or a part of them."""
    first, size = file[0], min(axis.signal.size for axis in file)
    signals = np.stack([axis.signal[:size][part] for axis in file])
    return evaluate_recording(CutRecording(signals, first.rate, first.source.teeth, first.source.immersion, first.rpm))


def longest(cuts: list[CutEvaluation]) -> CutEvaluation:
    """Return the longest cut."""
    return max(cuts, key=lambda heard: np.nan_to_num(heard.parts.end - heard.parts.begin))


def axes_of(folder: Path, source: Source) -> Iterator[list[Axis]]:
    """The axes of each file."""
    for path in sorted(folder.glob(source.pattern)):
        speed = source.rpm or float((re.findall(r"(\d+)RPM", path.name) or re.findall(r"(\d+)RPM", str(path)))[0])
        yield [
            Axis(path, sound.acceleration, sound.sample_rate, speed, source)
            for sound in (read_cut_recording(path, said) for said in _descriptions(source))
        ]


def _descriptions(source: Source) -> Iterator[Description]:
    """One for each axis."""
    places = [place for place, column in enumerate(source.columns) if column == "*"]
    for number, place in enumerate(places, 1):
        if source.options != EMPTY_DESCRIPTION:
            response = number if len(places) > 1 else None
            yield Description(**vars(source.options) | {"response": response})
        else:
            rest = ["-" if column == "*" else column for column in source.columns]
            yield Description(columns=(*rest[:place], "acceleration [m/s^2]", *rest[place + 1 :]))


def loud_part(signal: Floats, rate: float) -> tuple[int, int]:
    """Return the longest part above the log mean of quiet and loud pieces."""
    size = round(PIECE * rate)
    pieces = signal[: signal.size // size * size].reshape(-1, size)
    level = np.log10(np.std(pieces, axis=1) + np.finfo(np.float64).tiny)
    edge = np.diff(np.r_[0, (level > (np.min(level) + np.quantile(level, LOUD)) / 2).astype(int), 0])
    begin, end = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
    longest = int(np.argmax(end - begin))
    return int(begin[longest]) * size, int(end[longest]) * size


def comb_of(file: list[Axis], part: slice) -> list[Comb]:
    """The comb of a part of a file: one frequency for all axes, clarity for each axis."""
    scores = [_comb_scores(axis, part) for axis in file]
    tried, together = scores[0][0], np.mean([score for _, score in scores], axis=0)
    best = int(np.argmax(together))
    is_same, is_inside = np.abs(tried / tried[best] - 1) < SAME_SPEED, 0 < best < tried.size - 1
    return [Comb(float(tried[best]), float(np.max(score[is_same])) if is_inside else 0.0) for _, score in scores]


def _comb_scores(axis: Axis, part: slice) -> tuple[Floats, Floats]:
    """Frequencies that are tried (Hz), and the score of each, by code independent of the detector."""
    signal, turn = axis.signal[part], axis.rpm / 60
    power = np.abs(np.fft.rfft((signal - np.mean(signal)) * np.hanning(signal.size), PADDED * signal.size)) ** 2
    above = np.log1p(power / (median_filter(power, NEIGHBOURS) + np.finfo(np.float64).tiny))
    bins = PADDED * signal.size / axis.rate
    highest = int(min(HARMONICS, axis.rate / 2 / turn / (1 + AROUND)))
    tried = turn * np.arange(1 - AROUND, 1 + AROUND, PADDED / bins / (4 * HARMONICS * turn))
    multiples = [np.interp(k * tried * bins, np.arange(above.size), above) for k in range(1, highest + 1)]
    score = np.mean(multiples, axis=0)
    return tried, np.asarray(score / np.median(score))


def reference(file: list[Axis], heard: CutEvaluation) -> list[Comb]:
    """Return the combs of the window with the median frequency, as a spindle slows down where the load grows.

    The windows are all those of the steady part of a cut, else the middle of the loud part.
    """
    parts, rate = heard.parts, file[0].rate
    begin, end = loud_part(file[0].signal, rate)
    first = ((begin + end) / rate - WINDOW) / 2
    starts = np.array([max(first, begin / rate)])
    if parts.cut.stop > parts.cut.start:
        starts = np.arange(parts.steady_begin, max(parts.steady_end - WINDOW, parts.steady_begin) + 1e-9, WINDOW / 2)
        end = round(parts.steady_end * rate)
    windows = [slice(round(start * rate), min(round((start + WINDOW) * rate), end)) for start in starts.tolist()]
    combs = sorted((comb_of(file, window) for window in windows), key=lambda axes: axes[0].frequency)
    return combs[len(combs) // 2]


def judge_file(file: list[Axis], each: Tally, together: Tally) -> None:
    """Count a file, its axes separately and together."""
    combs, speeds = reference(file, longest(listened(file))), []
    for axis, comb in zip(file, combs, strict=True):
        cuts = listened([axis])
        each.add(cuts, comb)
        speeds.append(longest(cuts).speed_rpm)
    together.add(listened(file), max(combs, key=lambda comb: comb.score))
    pairs = [pair for pair in combinations(speeds, 2) if np.all(np.isfinite(pair))]
    each.pairs += len(pairs)
    each.apart += sum(abs(one / other - 1) > SAME_SPEED for one, other in pairs)


def _speed_word(heard: CutEvaluation, comb: Comb) -> str:
    if not comb.is_clear:
        return "unclear"
    if np.isnan(heard.speed_rpm):
        return "silent"
    return "right" if abs(heard.speed_rpm / 60 / comb.frequency - 1) < SAME_SPEED else "wrong"


def _is_on_harmonic(heard: CutEvaluation, turn: float) -> bool:
    """Return whether chatter was detected at a multiple of a turn (Hz)."""
    if heard.chatter is None or heard.verdict != "chatter":
        return False
    return bool(fold_frequency(heard.chatter.frequency, turn) < ON_HARMONIC * turn)


def words_on_air(file: list[Axis], only_air: bool) -> Iterator[str]:
    """Verdicts on windows without a cut: an air recording, else the parts before and after the cut."""
    axis, size = file[0], round(WINDOW * file[0].rate)
    begin, end = loud_part(axis.signal, axis.rate)
    spare = round(2 * PIECE * axis.rate)
    outside = ((0, axis.signal.size),) if only_air else ((0, begin - spare), (end + spare, axis.signal.size))
    for first, last in outside:
        for place in range(first, last - size + 1, size):
            yield from (heard.verdict for heard in listened(file, slice(place, place + size)))


def row(source: Source, each: Tally, together: Tally) -> str:
    """Return a row of the table."""
    words = ", ".join(f"{count} {word}" for word, count in together.words.most_common())
    words_told = sum(together.words[word] for word in ("stable", "chatter", "flip"))
    false = each.on_harmonic + together.on_harmonic
    return (
        f"| {source.title} | {each.found} of {each.cuts} | {each.speed_text} | {each.apart} of {each.pairs} | "
        f"{together.speed_text} | {words} | {together.words.total() - words_told} of {together.cuts} | "
        f"{together.contrary} | {false} |"
    )


def main() -> None:
    """Print the table."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("give the folder of the public recordings: python bench/real_cuts.py FOLDER")
    folder, began, air = Path(sys.argv[1]), time.process_time(), Counter[str]()
    names = COLUMNS.split(", ")
    print("| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|")
    for source in (*SOURCES, *AIR):
        each, together = Tally(), Tally()
        for file in axes_of(folder, source):
            if source in SOURCES:
                judge_file(file, each, together)
            air.update(words_on_air(file, only_air=source in AIR))
        if each.cuts:
            print(row(source, each, together), flush=True)
    print(f"\nwindows of air: {dict(air)}; {time.process_time() - began:.0f} s of CPU")


if __name__ == "__main__":
    main()
