"""Evaluated hits of a live test, their mean, and the published state."""

from functools import partial
from typing import Any

from acquisition import Hit, HitFlags, HitVerdict, RunningMean, evaluate_hit
from acquisition.hit_quality.evaluate_hit import evaluate_spectrum
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.tap.state import StatePublisher, TapState
from lobewatch.tap.tap_in_progress import TapInProgress, evaluate_safely

MIN_HITS_FOR_MEAN = 3
"""Hits in a mean with which others are compared."""


class EvaluatedHits:
    """Stored hits of a test and their mean, which is always that of the good ones."""

    def __init__(self, tap: TapInProgress, machine: Machine) -> None:
        """Resume with the stored hits."""
        self.tap = tap
        """Stored hits."""
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
        """Number of good hits still needed."""
        return max(self.wanted - self.tap.good, 0)

    @property
    def progress(self) -> str:
        """Progress of the test in words."""
        return f"{self.tap.good} of {self.wanted} good hits"

    def evaluate(self, hit: Hit) -> HitVerdict:
        """Evaluate a hit, also against the mean if that has enough hits. A good one is then part of the mean."""
        return evaluate_safely(lambda: self._evaluate(hit))

    def undo(self) -> int | None:
        """Take back the last good hit and return its index. None if there is none."""
        good = [i for i, flags in enumerate(self.tap.flags) if not flags]
        if not good:
            return None
        self._take_out(good[-1], HitVerdict(HitFlags.UNDONE))
        return good[-1]

    def recheck_first_hits(self) -> tuple[int, HitVerdict] | None:
        """Compare the first hits, which had no mean yet, with the mean of all others.

        Takes the first one that does not fit out of the mean, and returns its index and the reason.
        """
        if self.mean.frf is None or not MIN_HITS_FOR_MEAN < len(self.mean.hits) <= 2 * MIN_HITS_FOR_MEAN:
            return None
        for hit in self.mean.hits[:MIN_HITS_FOR_MEAN]:
            verdict = evaluate_safely(partial(self._compare, hit))
            if verdict.flags:
                number = next(i for i, tap_hit in enumerate(self.tap.hits) if tap_hit is hit)
                self._take_out(number, verdict)
                return number, verdict
        return None

    def _evaluate(self, hit: Hit) -> HitVerdict:
        mean = self.mean.frf if len(self.mean.hits) >= MIN_HITS_FOR_MEAN else None
        verdict = evaluate_hit(hit, mean, self._band)
        if not verdict.flags:
            self.mean.add(hit)
        return verdict

    def _compare(self, hit: Hit) -> HitVerdict:
        """Compare a hit of the mean with the others. All else was evaluated when it came."""
        return HitVerdict.from_findings(evaluate_spectrum(hit, self.mean.estimate_without(hit)))

    def _take_out(self, number: int, verdict: HitVerdict) -> None:
        self.tap.exclude(number, verdict.flags, verdict.text)
        self.mean.remove(self.tap.hits[number])


class TapPublisher(StatePublisher[TapState]):
    """Publisher of the state of a tap test."""

    def show_hits(self, hits: EvaluatedHits, **changes: Any) -> None:
        """Publish the list of hits, what follows from it, and other fields."""
        tap, mean = hits.tap, hits.mean
        changes |= {"mean_change": mean.relative_change, "settled": mean.has_converged}
        self.show(hits=tap.taken, good=tap.good, **changes)
