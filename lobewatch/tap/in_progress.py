"""A tap test in progress: its hits and its set-up, spooled one by one, so that nothing of it is lost."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from acquisition import (
    Channel,
    Circumstances,
    Hit,
    HitFlags,
    TapTest,
    Trigger,
    estimate_frf,
    judge_hit,
    new_tap_id,
    write_hit,
)
from acquisition.atomic import make_folder
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.reserve import Reserve
from lobewatch.tap.guarded_verdict import guarded_verdict
from lobewatch.tap.spool import RESUMABLE, SpooledHit, spooled_hits, spooled_trigger, tidy, write_set_up
from lobewatch.tap.state import TakenHit

FULL = (errno.ENOSPC, errno.EDQUOT)
"""Errors of a disk without room."""


@dataclass
class TapInProgress:
    """Hits so far, kept on disk one by one, so that a crash or an unplugged cable costs none of them."""

    id: str
    """Identity of the tap test to be."""
    circumstances: Circumstances
    """Circumstances of the test: who, what, when."""
    folder: Path
    """Folder in which its hits are spooled."""
    hits: list[Hit] = field(default_factory=list)
    """All hits so far."""
    flags: list[HitFlags] = field(default_factory=list)
    """Verdict on each; UNDONE where the operator took a good one back."""
    reasons: list[str] = field(default_factory=list)
    """Sentence on what was wrong with each; empty where it is averaged."""
    numbers: list[int] = field(default_factory=list)
    """Number of each, in the name of its file."""
    earlier: int = 0
    """Number of hits that were there when it was gone on with."""
    trigger: Trigger | None = None
    """Trigger by which its hits are recorded; None until that is chosen."""
    baseline: Hit | None = None
    """Record at rest; None until the self-check has run."""
    damaged: list[Path] = field(default_factory=list)
    """Files of an interrupted test that could not be read, where they were set aside."""
    left: list[str] = field(default_factory=list)
    """Interrupted tests that are not gone on with, a sentence each."""
    reserve: Reserve | None = None
    """Room on the disk that is held for it."""

    @property
    def good(self) -> int:
        """Number of hits that may be averaged."""
        return self.flags.count(HitFlags.OK)

    @property
    def taken(self) -> tuple[TakenHit, ...]:
        """Hits as a screen lists them."""
        hits = enumerate(zip(self.hits, self.flags, self.reasons, strict=True), 1)
        return tuple(
            TakenHit(i, flags, peak_text(hit), bool(flags & HitFlags.UNDONE), reason, i <= self.earlier)
            for i, (hit, flags, reason) in hits
        )

    def accept_device(self, sample_rate: float, channels: tuple[Channel, ...], description: str) -> None:
        """Note what the hits to come are recorded with; ValueError where those before them had another set-up."""
        earlier = self.hits[-1] if self.hits else self.baseline
        if earlier is not None and (earlier.sample_rate, earlier.sensors) != (sample_rate, channels):
            raise self.other_setup()
        if not self.hits:
            self.circumstances = replace(self.circumstances, device=description)

    def other_setup(self) -> ValueError:
        """The refusal to mix hits of two set-ups."""
        return ValueError(
            f"the interrupted test {self.id} was recorded with another length, sample rate or sensor; "
            "begin anew with --new"
        )

    def add(self, hit: Hit, flags: HitFlags, reason: str) -> None:
        """Keep a hit; on the disk when this returns."""
        number = max(self.numbers, default=-1) + 1
        self._store(number, hit, flags)
        self._append(number, hit, flags, reason)

    def add_spooled(self, spooled: SpooledHit) -> None:
        """Go on with a hit that is on the disk already."""
        verdict = guarded_verdict(lambda: judge_hit(spooled.hit))
        self._append(spooled.number, spooled.hit, spooled.flags | verdict.flags, verdict.text or spooled.flags.cure)
        self.circumstances = spooled.circumstances
        self.earlier = len(self.hits)

    def take_out(self, number: int, flags: HitFlags, reason: str) -> None:
        """Refuse a good hit (by its index) afterwards; it stays stored."""
        self._store(self.numbers[number], self.hits[number], flags)
        self.flags[number], self.reasons[number] = flags, reason

    def finish(self) -> TapTest:
        """The averaged tap test; ValueError where no hit is good."""
        return averaged(self.id, self.circumstances, self.hits, self.flags)

    def _append(self, number: int, hit: Hit, flags: HitFlags, reason: str) -> None:
        self.numbers.append(number)
        self.hits.append(hit)
        self.flags.append(flags)
        self.reasons.append(reason)

    def _store(self, number: int, hit: Hit, flags: HitFlags) -> None:
        """Write a hit, which is on the disk when this returns; where that is full, in the room that was held."""
        try:
            self._write(number, hit, flags)
        except OSError as error:
            if error.errno not in FULL or self.reserve is None or not self.reserve.release():
                raise
            self._write(number, hit, flags)

    def _write(self, number: int, hit: Hit, flags: HitFlags) -> None:
        make_folder(self.folder)
        if not self.hits and self.trigger is not None:
            write_set_up(self.folder, self.trigger)
        write_hit(self.folder / f"{number:04d}.h5", hit, self.circumstances, flags)


def averaged(tap_id: str, about: Circumstances, hits: Sequence[Hit], flags: Sequence[HitFlags]) -> TapTest:
    """The tap test of hits with the verdict on each, each as one sensor felt it; ValueError where none is good."""
    good = [hit for hit, flag in zip(hits, flags, strict=True) if not flag]
    frf = estimate_frf(good) if good[0].has_force else None
    return TapTest(tap_id, about, frf, tuple(replace(hit, beside=None) for hit in hits), tuple(flags))


def peak_text(hit: Hit) -> str:
    """Largest force of a hit, or without one its largest acceleration, with the unit."""
    if hit.has_force:
        return f"{hit.force.max():.0f} N"
    return f"{np.max(np.abs(hit.acceleration - np.median(hit.acceleration))):.0f} m/s²"


def begin_tap(folder: MachineFolder, circumstances: Circumstances, resume: bool = True) -> TapInProgress:
    """A new tap test, or the interrupted one of the same tool and direction; DataError where the journal is damaged."""
    folder.refuse_damage()
    tidy(folder)
    _remove_committed(folder)
    damaged, left = list[Path](), list[str]()
    interrupted = _interrupted(folder, circumstances, resume, damaged, left)
    tap_id = new_tap_id(circumstances)
    tap = interrupted or TapInProgress(tap_id, circumstances, folder.spool / tap_id)
    tap.damaged, tap.left = damaged, left
    return tap


def _remove_committed(folder: MachineFolder) -> None:
    """Hits that an ended program has left behind though their tap test is committed; kept where its file is damaged."""
    begun = [path for path in folder.spool.iterdir() if path.is_dir()] if folder.spool.is_dir() else []
    if begun:
        stored = {entry.id for entry in folder.taps()}
        for path in begun:
            if path.name in stored:
                shutil.rmtree(path, ignore_errors=True)


def _interrupted(
    folder: MachineFolder, circumstances: Circumstances, resume: bool, damaged: list[Path], left: list[str]
) -> TapInProgress | None:
    """The newest test of the same tool and direction to go on with, if that is wished; `left`: all others."""
    committed, newest = folder.committed, None
    for path in sorted(folder.spool.iterdir(), reverse=True) if folder.spool.is_dir() else []:
        if not path.is_dir() or path.name in committed:
            continue
        hits = spooled_hits(path, damaged)
        first = next(hits, None)
        if first is None:
            continue
        about = first.circumstances
        same = (about.tool, about.direction) == (circumstances.tool, circumstances.direction)
        if resume and newest is None and same and circumstances.created - about.created < RESUMABLE:
            newest = TapInProgress(path.name, about, path, trigger=spooled_trigger(path, damaged))
            for hit in (first, *hits):
                newest.add_spooled(hit)
            conditions = circumstances.conditions.over(newest.circumstances.conditions)
            newest.circumstances = replace(newest.circumstances, conditions=conditions)
        else:
            when = f"{about.created:%Y-%m-%d %H:%M} UTC, tool {about.tool}, direction {about.direction}"
            left.append(f"an interrupted test of {when} is still in {path}; delete that folder if it is not needed")
    return newest
