"""Errors, remarks for people, and checked names.

OSError
└── DeviceError     no device, a port in use, an unplugged cable, a device that falls silent
ValueError
└── DataError       a file that cannot be used, with the place and what to do
"""

from __future__ import annotations

import errno
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

PERMISSION_ERRNOS = (errno.EACCES, errno.EPERM, errno.EROFS)
"""Errors of a place that can only be read, or not even that."""
DISK_FULL_REMEDY = "make room on that disk"
TOO_MANY_FILES_REMEDY = "close other programs, too many files are open"
REMEDY_BY_ERRNO = {
    errno.ENOSPC: DISK_FULL_REMEDY,
    errno.EDQUOT: DISK_FULL_REMEDY,
    errno.EMFILE: TOO_MANY_FILES_REMEDY,
    errno.ENFILE: TOO_MANY_FILES_REMEDY,
    errno.ESTALE: "the network drive has lost it: mount it anew, then give the same command again",
    errno.EIO: "the disk fails: copy the folder to another one",
}
"""What to do where the system cannot do what it is asked for, by error number."""


class DeviceError(OSError):
    """The DAQ cannot be reached or has stopped."""

    def __init__(self, text: str, cure: str = "") -> None:
        """What is wrong, and what to do about it; str() is both."""
        super().__init__(f"{text}; {cure}" if cure else text)
        self.text = text
        """What is wrong, without a full stop."""
        self.cure = cure
        """What to do about it; empty where that is not known."""


class DataError(ValueError):
    """A file cannot be used for a tap test."""


def format_error(error: Exception) -> str:
    """Any error in a sentence; the kind of one that nobody has foreseen, too."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return format_os_error(error)
    if isinstance(error, (ValueError, OSError, ArithmeticError)):
        return str(error)
    return f"{type(error).__name__}, which should not be: {error}"


def format_os_error(error: OSError) -> str:
    """An error of the operating system in a sentence: where, what, and what to do where that is known."""
    failure = f"{error.filename or 'the disk'}: {error.strerror or error}"
    cure = REMEDY_BY_ERRNO.get(error.errno or 0, "")
    return f"{failure}; {cure}" if cure else failure


CONTROL_CHARACTERS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
"""Control characters (ESC, NUL, newline, tab ...), line separators, and halves of characters that no text can hold."""


def check_name(name: str, what: str) -> None:
    """ValueError for a name with a control character in it; `what` says in the message what is called so."""
    found = CONTROL_CHARACTERS.search(name)
    if found is not None:
        raise ValueError(
            f"{what}={name!r} holds the control character {found[0]!r}; leave it out: a name is made of letters, "
            "digits, signs and spaces"
        )


@dataclass(frozen=True)
class Remark:
    """One thing to know. Programs look at `code` and `about`; `text` and `cure` are for people and may be reworded.

    >>> remark = Remark("swept", "A", "the spindle sweeps 40 Hz", "tap it warm")
    >>> remark.finding, remark.code
    ('A: the spindle sweeps 40 Hz', 'swept')
    """

    code: str
    """Kind of remark: words in lower case joined by hyphens, listed in docs/remarks.md, never changed."""
    about: str
    """Thing it concerns: a program, a tap test, a mode ("1713 Hz"), a channel, a file; empty for the whole."""
    text: str
    """Finding, with figures and units, without a full stop."""
    cure: str = ""
    """Advice what to do about it; empty where nothing can be done or need be."""

    def __str__(self) -> str:
        """One sentence."""
        return self.finding + (f"; {self.cure}" if self.cure else "")

    @property
    def finding(self) -> str:
        """The same without the cure."""
        return ": ".join(filter(None, (self.about, self.text)))


def merge_remarks(remarks: Iterable[Remark]) -> list[Remark]:
    """Remarks that differ in nothing but what they are about as one, in the order of the first of each.

    >>> remarks = [Remark("small", program, "it is small") for program in ("A", "B")]
    >>> [(remark.code, remark.about) for remark in joined(remarks)]
    [('small', 'A, B')]
    """
    about: dict[Remark, list[str]] = {}
    for remark in remarks:
        about.setdefault(replace(remark, about=""), []).append(remark.about)
    return [replace(first, about=", ".join(dict.fromkeys(filter(None, names)))) for first, names in about.items()]
