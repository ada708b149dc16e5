"""A person at a terminal: a command on a pseudo-terminal, which is waited for and answered."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

ESCAPES = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]")


class Terminal:
    """A command whose standard input, output and error are one terminal."""

    def __init__(self, cwd: Path, *arguments: object, environment: Mapping[str, str] | None = None) -> None:
        self._master, slave = pty.openpty()
        command = [sys.executable, "-m", "lobewatch.cli", *map(str, arguments)]
        named = {**os.environ, "COLUMNS": "100", "LINES": "50", "TERM": "xterm", **(environment or {})}
        streams = {"stdin": slave, "stdout": slave, "stderr": slave}
        self.process = subprocess.Popen(command, cwd=cwd, env=named, start_new_session=True, **streams)  # type: ignore[call-overload]
        os.close(slave)
        self.text = ""
        self._seen = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._master)

    def wait_for(self, words: str, seconds: float = 40.0) -> str:
        """Return the output since the last call, up to a text."""
        end = time.monotonic() + seconds
        while (at := self.text.find(words, self._seen)) < 0:
            assert self._read(max(end - time.monotonic(), 0.0)), f"{words!r} has not come:\n{self.text}"
        new, self._seen = self.text[self._seen : at + len(words)], at + len(words)
        return new

    def type(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def answer(self, line: str) -> str:
        """Wait for the prompt and answer it; what stood there."""
        new = self.wait_for("> ")
        self.type(f"{line}\n")
        return new

    def end(self, seconds: float = 60.0) -> int:
        """Exit code; all that is left has come."""
        while self._read(seconds):
            pass
        return int(self.process.wait(seconds))

    def _read(self, seconds: float) -> bool:
        if not select.select([self._master], [], [], seconds)[0]:
            return False
        try:
            data = os.read(self._master, 65536)
        except OSError:  # all of them have closed it
            return False
        self.text += ESCAPES.sub("", data.decode(errors="replace"))
        return bool(data)
