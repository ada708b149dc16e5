"""The hits of a test with the verdict on each, and the mean of the good ones."""

from __future__ import annotations

from functools import partial

from acquisition import Hit, HitFlags, HitVerdict, RunningMean, judge_hit
from acquisition.verdicts.by_spectrum import by_spectrum
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.tap.guarded_verdict import guarded_verdict
from lobewatch.tap.in_progress import TapInProgress

FEWEST_FOR_MEAN = 3
"""Hits in a mean that others are compared with."""


class JudgedHits:
    """The spooled hits of a test, and their mean, which always is that of the good ones."""

    def __init__(self, tap: TapInProgress, machine: Machine) -> None:
        """Go on with what is spooled."""
        self.tap = tap
        """The hits on the disk."""
        self.wanted = machine.tap.hits
        """Number of good hits needed."""
        self.mean = RunningMean()
        """Mean of the good hits."""
        self._band = machine.mode.band_hz
        for hit, flags in zip(tap.hits, tap.flags, strict=True):
            if not flags:
                self.mean.add(hit)

    @property
    def missing(self) -> int:
        """Number of good hits still to come."""
        return max(self.wanted - self.tap.good, 0)

    @property
    def progress(self) -> str:
        """Progress of the test in words."""
        return f"{self.tap.good} of {self.wanted} good hits"

    def judge(self, hit: Hit) -> HitVerdict:
        """Verdict on a hit, against the mean too where that has enough hits to tell how far they scatter; a good one is
        in the mean when this returns."""
        return guarded_verdict(lambda: self._judge(hit))

    def add(self, hit: Hit, verdict: HitVerdict) -> None:
        """Keep a hit; on the disk when this returns."""
        self.tap.add(hit, verdict.flags, verdict.text)

    def undo(self) -> int | None:
        """Take back the last good hit and return its index; None where there is none."""
        good = [i for i, flags in enumerate(self.tap.flags) if not flags]
        if not good:
            return None
        self._take_out(good[-1], HitVerdict(HitFlags.UNDONE))
        return good[-1]

    def look_back(self) -> tuple[int, HitVerdict] | None:
        """Judge the first hits, which had no mean to be compared with, against the mean of all others.

        Takes the first of them that does not fit out of the mean, and returns its index and why.
        """
        if self.mean.frf is None or not FEWEST_FOR_MEAN < len(self.mean.hits) <= 2 * FEWEST_FOR_MEAN:
            return None
        for hit in self.mean.hits[:FEWEST_FOR_MEAN]:
            verdict = guarded_verdict(partial(self._compare, hit))
            if verdict.flags:
                number = next(i for i, tap_hit in enumerate(self.tap.hits) if tap_hit is hit)
                self._take_out(number, verdict)
                return number, verdict
        return None

    def _judge(self, hit: Hit) -> HitVerdict:
        mean = self.mean.frf if len(self.mean.hits) >= FEWEST_FOR_MEAN else None
        verdict = judge_hit(hit, mean, self._band)
        if not verdict.flags:
            self.mean.add(hit)
        return verdict

    def _compare(self, hit: Hit) -> HitVerdict:
        """Verdict on a hit of the mean against the others; all else about it was judged when it came."""
        return HitVerdict.of(by_spectrum(hit, self.mean.without(hit)))

    def _take_out(self, number: int, verdict: HitVerdict) -> None:
        self.tap.take_out(number, verdict.flags, verdict.text)
        self.mean.remove(self.tap.hits[number])
