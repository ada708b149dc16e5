"""Single keys from a terminal, without Enter."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any, Self


class Keys:
    """Keys pressed between __enter__ and __exit__; none where standard input is no terminal."""

    def __init__(self) -> None:
        """Nothing is changed yet."""
        self._before: list[Any] | None = None

    def __enter__(self) -> Self:
        """Let single keys through; Ctrl-C stays what it is."""
        if sys.platform != "win32" and sys.stdin.isatty():
            import termios
            import tty

            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin, termios.TCSADRAIN)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """The terminal as it was."""
        if sys.platform != "win32" and self._before is not None:
            import termios

            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)
            self._before = None

    def pressed(self) -> str:
        """The keys that wait, in lower case; empty where there are none."""
        if sys.platform == "win32":
            import msvcrt

            keys = []
            while msvcrt.kbhit():
                keys.append(msvcrt.getwch())
            return "".join(keys).lower()
        if self._before is None:
            return ""
        import os
        import select

        ready = select.select([sys.stdin], [], [], 0)[0]
        return os.read(sys.stdin.fileno(), 64).decode("ascii", "ignore").lower() if ready else ""
