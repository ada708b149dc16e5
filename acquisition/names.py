"""Names that people give: what must not stand in them, because it steers a terminal or ends a line."""

from __future__ import annotations

import re

CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
"""Control characters (ESC, NUL, newline, tab ...), line separators, and halves of characters that no text can hold."""


def check_name(name: str, what: str) -> None:
    """ValueError for a name with a control character in it; `what` says in the message what is called so."""
    found = CONTROL.search(name)
    if found is not None:
        raise ValueError(
            f"{what}={name!r} holds the control character {found[0]!r}; leave it out: a name is made of letters, "
            "digits, signs and spaces"
        )
