"""Rounds of the real command, ended by SIGKILL at a random moment while an emulated device streams.

    python tap_kills.py FOLDER PORT forked|started ROUNDS SEED

forked: the command in a copy of this program, which has everything loaded; started: a Python of its own each time.
Each round goes on where the one before was ended. Prints a JSON object a round: how far it was, and what is wrong.
"""

from __future__ import annotations

import os
import random
import re
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from tap_rounds import machine, say

from acquisition import Hit, read_tap_hits
from lobewatch.cli import main as command
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.verify_files import verify

LINES = 10
"""About as many as the command prints."""
HITS = 5
"""Number of hits of a test."""
DELAY = 0.03
"""After a line it is killed within this time (s)."""
Started = tuple[int, int]
"""Process, and what it prints."""


def forked(arguments: list[str]) -> Started:
    """Run the command in a fork of this process."""
    read, write = os.pipe()
    process = os.fork()
    if not process:
        _become(arguments, write)
    os.close(write)
    return process, read


def _become(arguments: list[str], pipe: int) -> NoReturn:
    for stream in (1, 2):
        os.dup2(pipe, stream)
    sys.stdout, sys.stderr = open(1, "w", buffering=1), open(2, "w", buffering=1)  # noqa: SIM115  (for good)
    sys.argv = ["lobewatch", *arguments]
    code: object = 1
    try:
        command()
        code = 0
    except SystemExit as end:
        code = end.code
    except BaseException:  # noqa: BLE001  (to be told to whoever started it)
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 0)


def started(arguments: list[str]) -> Started:
    """Run the command in a new process."""
    read, write = os.pipe()
    line = [sys.executable, "-m", "lobewatch.cli", *arguments]
    process = subprocess.Popen(line, stdout=write, stderr=write)
    process.returncode = 0  # waited for by its number
    os.close(write)
    return process.pid, read


class Kills:
    """One machine, tapped and killed again and again."""

    def __init__(self, path: Path, port: str, start: Callable[[list[str]], Started]) -> None:
        """Tapped once."""
        self._path, self._port, self._start = path, port, start
        machine(path, HITS)
        self._known = self._hits()
        self._saved = self._taps()

    def round(self, chance: random.Random, kill: bool = True) -> dict[str, object]:
        """One start, one kill."""
        lines = chance.randrange(LINES) if kill else sys.maxsize
        said, code = self._run(lines, chance.uniform(0, DELAY))
        peaks = re.findall(r"^ +\d+ / \d+ .*\((\d+) N\)", said, re.MULTILINE)
        about = {"fault": "killed", "hits": len(peaks), "saved": "\nsaved " in said, "ended": code}
        return about | {"wrong": self._wrong(said, [int(peak) for peak in peaks])}

    def _run(self, lines: int, delay: float) -> tuple[str, int]:
        process, pipe = self._start(["tap", str(self._path), "--port", self._port, "--accept", "emulated-device"])
        with os.fdopen(pipe, "rb") as stream:
            said = b""
            for _, line in zip(range(lines), stream, strict=False):
                said += line
            time.sleep(delay)
            if lines < sys.maxsize:
                os.kill(process, signal.SIGKILL)
            said += stream.read()
        _, status = os.waitpid(process, 0)
        return said.decode(), os.waitstatus_to_exitcode(status)

    def _wrong(self, said: str, peaks: list[int]) -> list[str]:
        """Return lost hits and wrong output of the command."""
        wrong = [f"verify: {remark}" for remark in verify(self._path).damage]
        wrong += [line for line in said.splitlines() if "Traceback" in line or line.startswith("error")]
        found = self._hits()
        if not self._known.keys() <= found.keys():
            wrong.append(f"lost: {len(self._known.keys() - found.keys())} hits of earlier rounds")
        new = [found[code] for code in found.keys() - self._known.keys()]
        missing = [peak for peak in peaks if peak not in new]
        if missing:
            wrong.append(f"lost: announced hits of {missing} N, there are {new} N")
        self._known = found
        committed = {entry.id for entry in MachineFolder(self._path).taps()}
        wrong += [f"lost: {name}" for name in re.findall(r"^saved (\S+)$", said, re.MULTILINE) if name not in committed]
        for name, content in self._saved.items():
            if (self._path / "taps" / name).read_bytes() != content:
                wrong.append(f"altered: {name}")
        self._saved = self._taps()
        return wrong

    def _taps(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in (self._path / "taps").glob("*.h5")}

    def _hits(self) -> dict[bytes, int]:
        """Peak force (N) of all hits that are anywhere, by their samples."""
        files = [*self._path.glob("taps/*.h5"), *self._path.glob("spool/*/[0-9]*.h5")]
        return {_codes(hit): round(float(hit.force.max())) for file in files for hit in read_tap_hits(file)[0]}


def _codes(hit: Hit) -> bytes:
    assert hit.codes is not None
    return hit.codes.tobytes()


def main() -> None:
    """See above."""
    path, port, how, rounds, seed = sys.argv[1:]
    kills, chance = Kills(Path(path), port, forked if how == "forked" else started), random.Random(int(seed))
    for _ in range(int(rounds)):
        say(kills.round(chance))
    say(kills.round(chance, kill=False))


if __name__ == "__main__":
    main()
