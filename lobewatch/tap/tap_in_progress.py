"""A tap test in progress: its hits, their mean, set-up and cross FRF."""

import errno
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import acquisition
from acquisition import (
    CROSS_TAP,
    Circumstances,
    DataError,
    Hit,
    HitDecision,
    HitFlags,
    HitVerdict,
    TapTest,
    evaluate_hit,
    write_hit,
)
from acquisition.errors import format_os_error, join_sentences
from acquisition.file_io import delete_folder, make_folder
from acquisition.hit_quality.best_hits import choose_best_hits
from acquisition.hit_quality.decide_hits import add_decisions
from acquisition.hit_quality.evaluate_hit import evaluate_spectrum
from acquisition.sensors.daq_timing import RATE_TOLERANCE
from acquisition.tap_test import decide_flags
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import DiskReserve
from lobewatch.machine.folder_updates import store_hit_decisions
from lobewatch.machine.journal.read_entries import read_hit_decisions
from lobewatch.tap import spool
from lobewatch.tap.hit_check import add_loose_sensor, add_steady_vibration, average_hits, evaluate_safely, format_peak
from lobewatch.tap.kept_rate import correct_rate, find_kept_rate
from lobewatch.tap.spool import SpooledHit
from lobewatch.tap.state import ListedHit

MIN_HITS_FOR_MEAN = 3
"""Hits in a mean with which others are compared."""


@dataclass
class TapInProgress:
    """Tap test in progress. Each hit is stored at once, so that a crash or an unplugged cable loses none."""

    id: str
    """Id of the future tap test."""
    circumstances: Circumstances
    """Circumstances of the test: operator, machine, time."""
    folder: MachineFolder
    """Machine folder, in whose spool its hits are stored."""
    hits: list[Hit] = field(default_factory=list)
    """All hits so far."""
    flags: list[HitFlags] = field(default_factory=list)
    """Flags of each hit, before decisions. UNDONE if the operator took a good one back."""
    decisions: tuple[HitDecision, ...] = ()
    """Decisions of the operator on hits. The journal counts the hits by their files until the test is committed."""
    reasons: list[str] = field(default_factory=list)
    """Sentence on what is wrong with each hit, empty if it is averaged."""
    numbers: list[int] = field(default_factory=list)
    """Number of each hit in the name of its file."""
    mean: acquisition.RunningMean = field(default_factory=acquisition.RunningMean)
    """Mean of the good hits, always of all of them."""
    n_resumed: int = 0
    """Number of hits that an interrupted test already had."""
    corrected_rate: float | None = None
    """Sample rate (Hz) that replaces a wrong one in the hits of an interrupted test, None if theirs was right."""
    trigger: acquisition.Trigger | None = None
    """Trigger settings of its hits, None until chosen."""
    baseline: Hit | None = None
    """Record at rest, None before the self-check."""
    damaged: list[Path] = field(default_factory=list)
    """Unreadable files of an interrupted test, where they were set aside."""
    not_resumed: list[str] = field(default_factory=list)
    """Interrupted tests that are not resumed, one sentence each."""
    reserve: DiskReserve | None = None
    """Disk space reserved for it."""

    @property
    def decided_flags(self) -> tuple[HitFlags, ...]:
        """Flags of each hit after the decisions."""
        return decide_flags(self.flags, self.decisions)

    @property
    def good(self) -> int:
        """Number of hits that may be averaged."""
        return self.decided_flags.count(HitFlags.OK)

    @property
    def missing(self) -> int:
        """Number of good hits still needed."""
        return max(self.folder.machine.tap.hits - self.good, 0)

    @property
    def progress(self) -> str:
        """Progress of the test in words."""
        return f"{self.good} of {self.folder.machine.tap.hits} good hits"

    @property
    def shown(self) -> dict[str, Any]:
        """Fields of TapState: the list of hits, and what follows from it."""
        by_hand = {decision.hit: decision.decision for decision in self.decisions}
        listed = enumerate(zip(self.hits, self.flags, self.decided_flags, self.reasons, strict=True), 1)
        hits = tuple(
            ListedHit(
                number=i,
                flags=flags,
                peak=format_peak(hit),
                undone=bool(flags & HitFlags.UNDONE),
                reason=reason if flags else "",
                earlier=i <= self.n_resumed,
                accepted=faults if by_hand.get(i) == "accept" else HitFlags.OK,
            )
            for i, (hit, faults, flags, reason) in listed
        )
        mean = {"mean_change": self.mean.relative_change, "settled": self.mean.has_converged}
        return {"hits": hits, "good": self.good, **mean}

    def accept_device(self, sample_rate: float, channels: tuple[acquisition.Channel, ...], description: str) -> None:
        """Note the set-up of the coming hits. ValueError if earlier hits have another one.

        A corrected rate of earlier hits becomes the new one if both agree: the rate was measured again.
        """
        kept = self.corrected_rate
        if kept is not None and 0 < abs(sample_rate / kept - 1) <= RATE_TOLERANCE:
            self.hits, self.corrected_rate = [correct_rate(hit, sample_rate) for hit in self.hits], sample_rate
            self.resume_mean()
        earlier = self.hits[-1] if self.hits else self.baseline
        if earlier is not None and (earlier.sample_rate, earlier.sensors) != (sample_rate, channels):
            raise self.make_setup_error()
        if not self.hits:
            self.circumstances = replace(self.circumstances, device=description)

    def make_setup_error(self) -> ValueError:
        """Return the error that rejects mixing hits of two set-ups."""
        text = f"the interrupted test {self.id} was recorded with another record length, sample rate or sensor"
        return ValueError(join_sentences(text, "Start a new test with plan_session.resume=False"))

    def add(self, hit: Hit, flags: HitFlags, reason: str) -> None:
        """Store a hit. It is on the disk when this returns."""
        number = max(self.numbers, default=-1) + 1
        self._store(partial(self._write, number, hit, flags))
        self._append(number, hit, flags, reason)

    def add_spooled(self, spooled: SpooledHit) -> None:
        """Resume with a hit that is already on the disk."""
        verdict = evaluate_safely(lambda: evaluate_hit(spooled.hit))
        self._append(spooled.number, spooled.hit, spooled.flags | verdict.flags, verdict.text or spooled.flags.cure)
        self.circumstances = spooled.circumstances
        self.n_resumed = len(self.hits)

    def evaluate(self, hit: Hit) -> HitVerdict:
        """Evaluate a hit, also against the mean if that has enough hits. A good one is then part of the mean."""
        return evaluate_safely(lambda: self._evaluate(hit))

    def exclude(self, number: int, flags: HitFlags, reason: str) -> None:
        """Reject a good hit (by its index) afterwards. It stays stored."""
        self._store(partial(self._write, self.numbers[number], self.hits[number], flags))
        self.flags[number], self.reasons[number] = flags, reason
        self.mean.remove(self.hits[number])

    def undo(self) -> int | None:
        """Take back the last good hit and return its index. None if there is none."""
        number = max((i for i, flags in enumerate(self.decided_flags) if not flags), default=None)
        if number is not None and self.flags[number]:
            self.decide(number, accept=False)
        elif number is not None:
            self.exclude(number, HitFlags.UNDONE, "")
        return number

    def decide(self, number: int, *, accept: bool) -> None:
        """Accept or reject a hit (by its index). The decision is in the journal when this returns.

        ValueError, and nothing is stored, if the hit cannot be accepted or is as wished already.
        """
        decision = HitDecision(number + 1, "reject")
        if accept:
            codes = self.flags[number].codes
            decision = HitDecision(number + 1, "accept", codes) if codes else HitDecision(number + 1, "undo")
        if accept != bool(self.decided_flags[number]):
            raise ValueError(f"hit {number + 1} is already {'accepted' if accept else 'rejected'}.")
        decisions, mean = add_decisions(self.flags, self.decisions, [decision]), copy(self.mean)
        (mean.add if accept else mean.remove)(self.hits[number])
        entered = replace(decision, hit=self.numbers[number] + 1)
        self._store(partial(store_hit_decisions, self.folder, self.id, [entered]))
        self.decisions, self.mean = decisions, mean

    def resume_mean(self) -> None:
        """Average the hits of the interrupted test, after the decisions on those that are left."""
        entered = read_hit_decisions(self.folder.journal.read().other_entries).get(self.id, ())
        left = [made for made in entered if made.hit - 1 in self.numbers]
        self.decisions = tuple(replace(made, hit=self.numbers.index(made.hit - 1) + 1) for made in left)
        self.mean = acquisition.RunningMean()
        for hit in (hit for hit, flags in zip(self.hits, self.decided_flags, strict=True) if not flags):
            self.mean.add(hit)

    def recheck_first_hits(self) -> tuple[int, HitVerdict] | None:
        """Compare the first hits, which had no mean yet, with the mean of all others.

        Takes the first one that does not fit out of the mean, and returns its index and the reason.
        """
        references = self._references
        if self.mean.frf is None or not MIN_HITS_FOR_MEAN < len(references) <= 2 * MIN_HITS_FOR_MEAN:
            return None
        for hit in references[:MIN_HITS_FOR_MEAN]:
            others = [other for other in references if other is not hit]
            verdict = evaluate_safely(partial(_compare, hit, others))
            if verdict.flags:
                number = next(i for i, tap_hit in enumerate(self.hits) if tap_hit is hit)
                self.exclude(number, verdict.flags, verdict.text)
                return number, verdict
        return None

    def finish(self) -> TapTest:
        """Return the averaged tap test, of the best hits if there are more than needed. ValueError if none is good."""
        accepted = self._accepted
        rest = [i for i, flags in enumerate(self.decided_flags) if not flags and i not in accepted]
        wanted = max(self.folder.machine.tap.hits - len(accepted), 0)
        best = choose_best_hits([self.hits[i] for i in rest], wanted)
        for i in set(rest) - {rest[k] for k in best}:
            self.flags[i] |= HitFlags.SURPLUS
        return average_hits(self.id, self.circumstances, self.hits, self.flags, self.decisions)

    @property
    def _accepted(self) -> set[int]:
        """Indices of the hits that the operator has accepted."""
        return {decision.hit - 1 for decision in self.decisions if decision.decision == "accept"}

    def _evaluate(self, hit: Hit) -> HitVerdict:
        references, mean = self._references, self.mean.frf
        if len(references) < MIN_HITS_FOR_MEAN:
            mean = None
        elif mean is not None and len(references) < len(self.mean.hits):
            mean = acquisition.estimate_frf(references)
        verdict = evaluate_hit(hit, mean, self.folder.machine.mode.band_hz)
        verdict = add_loose_sensor(add_steady_vibration(verdict, hit, self.baseline), hit, references)
        if not verdict.flags:
            self.mean.add(hit)
        return verdict

    @property
    def _references(self) -> list[Hit]:
        """Hits of the mean that the operator has not accepted, to compare others with."""
        accepted = [self.hits[i] for i in self._accepted]
        return [hit for hit in self.mean.hits if not any(hit is one for one in accepted)]

    def _append(self, number: int, hit: Hit, flags: HitFlags, reason: str) -> None:
        self.numbers.append(number)
        self.hits.append(hit)
        self.flags.append(flags)
        self.reasons.append(reason)

    def _store(self, write: Callable[[], None]) -> None:
        """Write something to the disk. If that is full, use the reserved space."""
        try:
            write()
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT) or self.reserve is None or not self.reserve.release():
                raise
            write()

    def _write(self, number: int, hit: Hit, flags: HitFlags) -> None:
        folder = self.folder.spool / self.id
        make_folder(folder)
        if not self.hits and self.trigger is not None:
            spool.write_setup(folder, self.trigger)
        write_hit(folder / f"{number:04d}.h5", hit, self.circumstances, flags)


def _compare(hit: Hit, others: Sequence[Hit]) -> HitVerdict:
    """Compare a hit of the mean with the others. All else was evaluated when it came."""
    return HitVerdict.from_findings(evaluate_spectrum(hit, acquisition.estimate_frf(others)))


def begin_tap(folder: MachineFolder, circumstances: Circumstances, resume: bool = True) -> TapInProgress:
    """Begin a tap test, or resume the interrupted one of the same tool and direction.

    DataError if the journal is damaged.
    """
    folder.refuse_damage()
    spool.clean_spool(folder)
    _remove_committed(folder)
    new = TapInProgress(acquisition.new_tap_id(circumstances), circumstances, folder)
    tap = _find_interrupted(new, resume) or new
    tap.damaged, tap.not_resumed = new.damaged, new.not_resumed
    return tap


def _remove_committed(folder: MachineFolder) -> None:
    """Remove hits left behind though their tap test is committed. Keep them if its file is damaged."""
    begun = [path for path in folder.spool.iterdir() if path.is_dir()] if folder.spool.is_dir() else []
    stored = {entry.id for entry in folder.taps()} if begun else set[str]()
    for path in begun:
        if path.name in stored:
            delete_folder(path)


def _find_interrupted(new: TapInProgress, resume: bool) -> TapInProgress | None:
    """Return the newest test of the tool and direction of a new one, if wished. The new one notes all others."""
    folder, circumstances = new.folder, new.circumstances
    committed, newest = folder.committed_ids, None
    for path in sorted(folder.spool.iterdir(), reverse=True) if folder.spool.is_dir() else []:
        if not path.is_dir() or path.name in committed:
            continue
        hits = spool.read_spooled_hits(path, new.damaged)
        if (first := next(hits, None)) is None:
            continue
        about = first.circumstances
        same = (about.tool, about.direction) == (circumstances.tool, circumstances.direction)
        rate, fault = _find_rate(folder, path)
        is_recent = circumstances.created - about.created < spool.MAX_RESUME_AGE
        if resume and newest is None and same and is_recent and not fault:
            newest = TapInProgress(path.name, about, folder, trigger=spool.read_spooled_trigger(path, new.damaged))
            newest.corrected_rate = rate
            for hit in (first, *hits):
                newest.add_spooled(hit._replace(hit=correct_rate(hit.hit, rate)))
            newest.resume_mean()
            conditions = circumstances.conditions.with_defaults(newest.circumstances.conditions)
            newest.circumstances = replace(newest.circumstances, conditions=conditions)
        else:
            test = f"{about.created:%Y-%m-%d %H:%M} UTC, tool {about.tool}, direction {about.direction}"
            text = f"An interrupted test ({test}{fault and f', {fault}'}) is still in {path}"
            new.not_resumed.append(join_sentences(text, "Delete this folder if you do not need the test"))
    return newest


def _find_rate(folder: MachineFolder, test: Path) -> tuple[float | None, str]:
    """Return the sample rate that replaces that of the hits, None for their own, and why they cannot be resumed."""
    try:
        return find_kept_rate(folder.machine.daq, test), ""
    except DataError as error:
        return None, str(error)


MIN_CROSS_TAP_HITS = 3
"""Good hits needed for a cross FRF, chosen: fewer do not show their scatter."""


class CrossTapResult(NamedTuple):
    """Result of the cross tap test that the same hits give."""

    tap_id: str | None
    """Id of the saved tap test, None if it was not saved."""
    text: str
    """Sentence for the operator."""


def commit_cross_tap(tap: TapInProgress, commit: Callable[[TapTest], None]) -> CrossTapResult | None:
    """Save the cross tap test of a finished test of a driving point. None if no second sensor recorded it.

    It uses the hits that are good at the driving point and in the second sensor. A failure is reported and does not
    affect the other test.
    """
    numbers = [i for i, hit in enumerate(tap.hits) if hit.cross_hit is not None]
    if not numbers:
        return None
    hits = [cross for hit in tap.hits if (cross := hit.cross_hit) is not None]
    first = [tap.decided_flags[i] for i in numbers]
    found = [
        tap.flags[i] | (HitFlags.OK if tap.decided_flags[i] else _evaluate_cross_hit(hit))
        for i, hit in zip(numbers, hits, strict=True)
    ]
    decisions = tuple(
        replace(made, hit=numbers.index(made.hit - 1) + 1) for made in tap.decisions if made.hit - 1 in numbers
    )
    verdicts = decide_flags(found, decisions)
    good, wanted = verdicts.count(HitFlags.OK), first.count(HitFlags.OK)
    faults = {flags.words for flags, before in zip(verdicts, first, strict=True) if flags and not before}
    used = f"{good} of the {wanted} hits in x ({', '.join(sorted(faults))} in y)" if faults else f"the {good} hits in x"
    about = replace(tap.circumstances, direction=CROSS_TAP)
    try:
        if good < MIN_CROSS_TAP_HITS:
            raise ValueError(f"only {used} are usable. Check the sensor along y.")
        test = average_hits(acquisition.new_tap_id(about), about, hits, found, decisions)
        commit(test)
    except (ArithmeticError, OSError, ValueError) as error:
        why = format_os_error(error) if isinstance(error, OSError) else str(error)
        return CrossTapResult(None, f"{CROSS_TAP} is not saved: {why.rstrip('.')}.")
    return CrossTapResult(test.id, f"{CROSS_TAP} is also saved, from {used}.")


def _evaluate_cross_hit(hit: Hit) -> HitFlags:
    """Return the faults of a hit as the second sensor recorded it, which may hardly respond."""
    if np.ptp(hit.acceleration) == 0:
        return HitFlags.NOT_EVALUATED
    return evaluate_safely(lambda: evaluate_hit(hit)).flags & ~HitFlags.NO_RESPONSE
