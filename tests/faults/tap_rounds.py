"""Rounds of a small tap test in programs of their own: each ends by a fault, and another goes on where it stopped.

    python tap_rounds.py FOLDER faults STEP FIRST     every STEP-th pair of file call and fault, from the FIRST on
    python tap_rounds.py FOLDER power STEP FIRST      every STEP-th power cut

Prints a JSON object a round: the fault, the call, what the operator was told, and what is wrong afterwards (nothing).
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from faulty_files import ERRORS, FAULTS, KILLED, Call, FaultyFiles
from power_loss import WAYS, Disk

from acquisition import (
    Channel,
    Circumstances,
    DataError,
    HammeredStructure,
    Hammering,
    SimulatedSource,
    Structure,
    TapTest,
    read_tap,
)
from acquisition.errors import format_os_error
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.verify_files import verify
from lobewatch.tap.session import TapSession

RATE = 25600.0
CHANNELS = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))
BEAM = Structure(np.array([900.0, 1722.0]), np.array([0.03, 0.03]), np.array([8e7, 3.2e7]), 1e-9)
HITS = 3
SET_UP = {"record_s": 0.08, "trigger_n": 20.0}


@dataclass
class Told:
    """Output of a test process before it ended."""

    hits: int = 0
    """Announced."""
    saved: str = ""
    """Digest of the tap test that was called saved."""
    error: str = ""
    """Its last words."""
    calls: list[Call] = field(default_factory=list)
    """Recorded file calls, with announcements between them."""


def machine(path: Path, hits: int = HITS) -> None:
    """Create a machine with short hits, tapped once."""
    toml = make_machine_folder(path, "new_machine.toml")
    settings = "".join(f"{name} = {value}\n" for name, value in SET_UP.items())
    text = re.sub(r"^hits = 10", f"hits = {hits}\n{settings}", toml.read_text("utf-8"), flags=re.MULTILINE)
    toml.write_text(text.replace("high_rpm = 24000", "high_rpm = 24000\nsteps = 50"), "utf-8")
    session(path, 1).run()


def session(path: Path, seed: int, announce: Any = lambda _: None) -> TapSession:
    """Return a tap test with hits by seed. `announce` is called with the number of hits."""
    how = Hammering(double_hits=0, overloads=0, interval_range=(0.15, 0.2))
    source = SimulatedSource(HammeredStructure(BEAM, RATE, np.random.default_rng(seed), how), CHANNELS, RATE, 10**6)
    folder = MachineFolder(path)
    about = Circumstances("m", datetime.now(UTC), "reference", machine_toml=folder.toml.read_text("utf-8"))
    made: list[TapSession] = []

    def clock() -> float:
        if made:
            announce(len(made[0].state.hits))
        return 0.0

    made.append(TapSession(folder, lambda: source, about, guided=False, clock=clock))
    return made[0]


def digest(tap: TapTest) -> str:
    """Return the digest of all measured data."""
    codes = (hit.codes for hit in tap.hits)
    parts = [*(code.tobytes() for code in codes if code is not None), tap.required_frf.receptance.tobytes()]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def apart(path: Path, seed: int, at: int = -1, fault: str = "") -> Told:
    """Run a tap test in a process of its own, with a fault at this file call."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        os.close(read)
        _child(path, seed, FaultyFiles(path, at, fault), write)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    told = _heard(said)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, KILLED):
        told.error = f"ended with {code}: {told.error}"
    return told


def _child(path: Path, seed: int, files: FaultyFiles, pipe: int) -> None:
    say, heard, code = os.write, 0, 0

    def tell(kind: str, what: object) -> None:
        files.calls.append(Call(kind, str(what)))
        say(pipe, pickle.dumps((kind, what)))

    def announce(hits: int) -> None:
        nonlocal heard
        if hits > heard:
            heard = hits
            tell("hits", hits)

    files.begin()
    try:
        tell("saved", digest(session(path, seed, announce).run()))
    except DataError as error:
        tell("error", str(error))
    except OSError as error:  # before the test has begun; the command says it so
        tell("error", format_os_error(error))
    except BaseException as error:  # noqa: BLE001  (what no operator should see)
        tell("error", f"{type(error).__name__}: {error}")
        code = 1
    whole = pickle.dumps(("calls", files.calls))
    while whole:
        whole = whole[say(pipe, whole) :]
    os._exit(code)


def _heard(said: bytes) -> Told:
    told, stream = Told(), io.BytesIO(said)
    while stream.tell() < len(said):
        kind, what = pickle.load(stream)
        setattr(told, kind, what)
    return told


class Rounds:
    """One machine, and what a tap test of it is without a fault."""

    def __init__(self, work: Path) -> None:
        """Tap it once for the reference."""
        self._work, self._pristine = work / "work", work / "m"
        machine(self._pristine)
        self._before = self._taps(self._pristine)
        self.disk = Disk(self._pristine)
        shutil.copytree(self._pristine, self._work)
        told = apart(self._work, 2)
        self.calls = told.calls
        found = self._taps(self._work)
        (new,) = found.keys() - self._before.keys()
        self._hits = [hit.codes.tobytes() for hit in found[new].hits if hit.codes is not None]

    @property
    def file_calls(self) -> list[Call]:
        """Calls that can fail."""
        return [call for call in self.calls if call.name not in ("hits", "saved", "error")]

    def fault(self, at: int, fault: str) -> dict[str, Any]:
        """Run a tap test with this fault and return its outcome."""
        self._clear()
        shutil.copytree(self._pristine, self._work)
        told = apart(self._work, 2, at, fault)
        call = self.file_calls[at]
        about = {"fault": fault, "call": call.name, "at": at, "file": re.sub(r"[0-9a-f]{4,}|\d{4,}", "*", call.path)}
        wrong = [*self._not_told(told, fault), *self._lost(told)]
        return about | {"told": told.error, "wrong": wrong}

    def power_cut(self, at: int, way: str) -> dict[str, Any]:
        """Cut the power after so many calls and return the outcome of the tap test."""
        self._clear()
        disk = Disk(self._pristine)
        moved = [replace(one, path=self._moved(one.path), to=self._moved(one.to)) for one in self.calls[:at]]
        disk.replay(moved)
        disk.survivor(way, self._work)
        told = Told()
        for call in moved:
            if call.name == "hits":
                told.hits = int(call.path)
            elif call.name == "saved":
                told.saved = call.path
        about = {"fault": f"power cut, {way}", "call": self.calls[at - 1].name if at else "", "at": at}
        return about | {"told": "", "wrong": self._lost(told)}

    def _moved(self, path: str) -> str:
        return path.replace(str(self._work), str(self._pristine))

    def _clear(self) -> None:
        shutil.rmtree(self._work, ignore_errors=True)

    def _not_told(self, told: Told, fault: str) -> Iterator[str]:
        """Return an error unless a failing call ended the test in one clear sentence or did not matter."""
        if fault in ERRORS and not told.saved:
            text = told.error
            if "\n" in text or "Errno" in text or str(self._work) not in text or ". " not in text:
                yield f"no clear error: {text!r}"

    def _lost(self, told: Told) -> list[str]:
        """Return errors in the files left by a test, and in those after a second test has resumed it."""
        wrong = [f"verify: {remark}" for remark in verify(self._work).damage]
        try:
            session(self._work, 3).run()
        except Exception as error:  # noqa: BLE001  (whatever it is)
            return [*wrong, f"cannot go on: {type(error).__name__}: {error}"]
        remarks = [remark for remark in verify(self._work).remarks if not remark.about.endswith(".torn")]
        wrong += [f"verify in the end: {remark}" for remark in remarks]
        return [*wrong, *self._missing(told), *self._left_over()]

    def _missing(self, told: Told) -> Iterator[str]:
        found = self._taps(self._work)
        there = {hit.codes.tobytes() for tap in found.values() for hit in tap.hits if hit.codes is not None}
        if len(found) < len(self._before) + 1:
            yield f"{len(found)} tap tests"
        for name, tap in self._before.items():
            if name not in found or digest(found[name]) != digest(tap):
                yield f"lost: tap test {name}"
        lost = [number for number, hit in enumerate(self._hits[: told.hits], 1) if hit not in there]
        if lost:
            yield f"lost: hits {lost} of {told.hits} announced"
        if told.saved and told.saved not in map(digest, found.values()):
            yield "lost: the saved tap test"

    def _left_over(self) -> Iterator[str]:
        for path in self._work.rglob("*"):
            if path.suffix == ".tmp" or path.parent.name == "spool":
                yield f"left over: {path.relative_to(self._work)}"

    @staticmethod
    def _taps(path: Path) -> dict[str, TapTest]:
        folder = MachineFolder(path)
        return {entry.id: read_tap(path / entry.file) for entry in folder.taps()}


def say(found: dict[str, Any]) -> None:
    """Print it as a line of JSON."""
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()


def main() -> None:
    """See above."""
    work, what, step, first = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    rounds = Rounds(work)
    if what == "faults":
        numbers = range(len(rounds.file_calls))
        pairs = [(at, fault) for fault in FAULTS for at in numbers if _is_possible(rounds.file_calls[at], fault)]
        for at, fault in pairs[first::step]:
            say(rounds.fault(at, fault))
    else:
        cuts = [(at, way) for at in range(len(rounds.calls) + 1) for way in WAYS]
        for at, way in cuts[first::step]:
            say(rounds.power_cut(at, way))


def _is_possible(call: Call, fault: str) -> bool:
    return fault != "killed half-way" or call.name == "write"


if __name__ == "__main__":
    main()
