"""Passwords in addresses: taken out of texts, copies, arguments and the process title."""

import contextlib
import re
import sys
from pathlib import Path
from urllib.parse import unquote

ADDRESS_PASSWORD = re.compile(r"""(?i)\b([a-z][a-z0-9+.-]{0,20}:/+[^\s/?#@:"'<>]{0,200}):([^\s"'<>]{0,1000})@""")
"""User and password in an address, to its last at sign: a password may hold one that is not percent-encoded.

The lengths are limited, so that a text made to be slow is not.
"""
QUERY_PASSWORD = re.compile(r"""(?i)\b((?:ssl)?password=)[^\s&"'<>]+""")
"""Password among the settings of an address or a connection text of PostgreSQL."""
ARGUMENT_FIELDS = slice(45, 47)
"""Start and end of the arguments in memory, in /proc/self/stat after the name of the program (proc(5))."""

_GIVEN_ADDRESSES: dict[str, str] = {}


def hide_passwords(text: str) -> str:
    """Remove the passwords of all addresses in a text.

    Parameters
    ----------
    text
        Any text: a sentence, a machine.toml, an argument.

    Returns
    -------
    str
        The text with `scheme://user@` for `scheme://user:password@`, and without the value of `password=`.

    Examples
    --------
    >>> hide_passwords("mqtt://mill:secret@broker.example/plant and postgresql://h/db?password=secret&user=u")
    'mqtt://mill@broker.example/plant and postgresql://h/db?password=&user=u'
    """
    if ":/" not in text and "=" not in text:
        return text
    return QUERY_PASSWORD.sub(r"\1", ADDRESS_PASSWORD.sub(r"\1@", text))


def split_password(address: str) -> tuple[str, str]:
    """Split an address into itself without a password, and the decoded password; empty if there is none."""
    match = ADDRESS_PASSWORD.search(address)
    return (ADDRESS_PASSWORD.sub(r"\1@", address), unquote(match[2])) if match else (address, "")


def hide_arguments() -> None:
    """Remove passwords from sys.argv and from the process title, where all users of the computer can read them.

    `restore_password` gives them back to the one connection that needs them.
    """
    for place, given in enumerate(sys.argv):
        hidden = hide_passwords(given)
        if hidden != given:
            _GIVEN_ADDRESSES[hidden] = given
            sys.argv[place] = hidden
            with contextlib.suppress(OSError, ValueError):  # no /proc: not Linux
                _overwrite_argument(given, hidden)


def restore_password(address: str) -> str:
    """Return an address as it was given on the command line."""
    return _GIVEN_ADDRESSES.get(address, address)


def _overwrite_argument(given: str, hidden: str) -> None:
    """Overwrite an argument in the memory from which Linux reads the process title."""
    import ctypes

    fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    start, end = map(int, fields[ARGUMENT_FIELDS])
    before = ctypes.string_at(start, end - start)
    old, new = (text.encode(errors="surrogateescape") for text in (given, hidden))
    ctypes.memmove(start, before.replace(old, new.ljust(len(old), b" ")), end - start)
