"""The live tap test: hits from a source, each spooled before its verdict is shown, until enough are good."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path

from acquisition import (
    Circumstances,
    DataError,
    Hit,
    HitFlags,
    Source,
    TapTest,
    Trigger,
    average_good,
    capture_hits,
    check_hit,
    new_tap_id,
    read_tap_hits,
    write_hit,
)
from lobewatch.machine_folder import MachineFolder

RESERVE_BYTES = 50_000_000
"""Free disk space needed before the trigger is armed."""
RESUMABLE = timedelta(hours=12)
"""An interrupted test older than this is not gone on with."""

OnHit = Callable[[Hit, HitFlags, int], None]
"""Called with each hit, its verdict and the number of good ones so far."""


@dataclass
class TapInProgress:
    """Hits so far, kept on disk one by one, so that a crash or an unplugged cable costs none of them."""

    id: str
    """Identity of the tap test to be."""
    circumstances: Circumstances
    """Who, what, when."""
    folder: Path
    """Where its hits are spooled."""
    hits: list[Hit] = field(default_factory=list)
    """All hits so far."""

    @property
    def good(self) -> int:
        """How many hits may be averaged."""
        return sum(not check_hit(hit) for hit in self.hits)

    def add(self, hit: Hit) -> None:
        """Keep a hit; on the disk when this returns."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_hit(self.folder / f"{len(self.hits):04d}.h5", hit, self.circumstances)
        self.hits.append(hit)

    def finish(self) -> TapTest:
        """The averaged tap test."""
        frf, flags = average_good(self.hits)
        return TapTest(self.id, self.circumstances, frf, tuple(self.hits), flags)


def begin_tap(folder: MachineFolder, circumstances: Circumstances, resume: bool = True) -> TapInProgress:
    """A new tap test, or the interrupted one of the same tool and direction; DataError where the disk is full."""
    free = shutil.disk_usage(folder.path).free
    if free < RESERVE_BYTES:
        raise DataError(
            f"{folder.path}: {free / 1e6:.0f} MB free on this disk; a tap test needs {RESERVE_BYTES / 1e6:.0f} MB"
        )
    spooled = sorted(folder.spool.iterdir(), reverse=True) if folder.spool.is_dir() else []
    committed = {entry.id for entry in folder.taps()}
    for path in spooled if resume else []:
        files = sorted(path.glob("*.h5"))
        if not files or path.name in committed:
            continue
        about = read_tap_hits(files[0])[1]
        same = (about.tool, about.direction) == (circumstances.tool, circumstances.direction)
        if same and circumstances.created - about.created < RESUMABLE:
            return TapInProgress(path.name, about, path, [read_tap_hits(file)[0][0] for file in files])
    tap_id = new_tap_id(circumstances)
    return TapInProgress(tap_id, circumstances, folder.spool / tap_id)


def take_hits(tap: TapInProgress, source: Source, trigger: Trigger, wanted: int, on_hit: OnHit) -> None:
    """Add hits until `wanted` are good. The source is started and stopped here.

    Raises DeviceError where the source fails, ValueError where earlier hits were recorded with another set-up.
    """
    good = tap.good
    setups = {(hit.force.size, hit.sample_rate) for hit in tap.hits}
    if setups - {(trigger.n_samples, source.sample_rate)}:
        raise ValueError(
            f"the interrupted test {tap.id} was recorded with another length or sample rate; begin anew with --new"
        )
    if good >= wanted:
        return
    source.start()
    for hit in capture_hits(source, trigger):
        tap.add(hit)
        flags = check_hit(hit)
        good += not flags
        on_hit(hit, flags, good)
        if good >= wanted:
            break
    source.stop()


def trigger_for(folder: MachineFolder, sample_rate: float) -> Trigger:
    """Trigger and record as machine.toml sets them."""
    tap = folder.machine.tap
    return Trigger(tap.trigger_n, round(tap.record_s * sample_rate), round(tap.pre_trigger_s * sample_rate))
