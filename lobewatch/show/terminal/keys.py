"""Single keys from a terminal, without Enter."""

from __future__ import annotations

import re
import sys
from types import TracebackType
from typing import Any, Self

PAGE_UP = ("\x1b[5~", "\xe0I", "\0I")
"""Page Up as terminals and as Windows send it: presenters and foot switches do."""
SPECIAL = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.)|[\xe0\0].", re.DOTALL)
"""Arrows and the like."""


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
            return letters("".join(keys))
        if self._before is None:
            return ""
        import os
        import select

        ready = select.select([sys.stdin], [], [], 0)[0]
        return letters(os.read(sys.stdin.fileno(), 64).decode("ascii", "ignore")) if ready else ""


def letters(typed: str) -> str:
    """What was typed in lower case, Page Up as "u"; other keys that send more than one character count for nothing."""
    for page_up in PAGE_UP:
        typed = typed.replace(page_up, "u")
    return SPECIAL.sub("", typed).lower()
