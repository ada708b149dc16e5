"""Errors and remarks with codes and remedies, and checks of names.

OSError
└── DeviceError     no device, a port in use, an unplugged cable, a device that falls silent
ValueError
└── DataError       a file that cannot be used, with the place and what to do
"""

import errno
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from acquisition.credentials import hide_passwords

PERMISSION_ERRNOS = (errno.EACCES, errno.EPERM, errno.EROFS)
"""Error numbers of a place without write permission or without any."""
REMEDY_BY_ERRNO = {
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR), "Check this path"),
    **dict.fromkeys((errno.EEXIST, errno.EISDIR), "Choose another name"),
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "Free space on this disk"),
    **dict.fromkeys((errno.EMFILE, errno.ENFILE), "Close other programs: too many files are open"),
    errno.ESTALE: "The network drive was lost: mount the drive again, then repeat the command",
    errno.EIO: "The disk is failing: copy the folder to another disk",
}
"""Remedy for errors of the operating system, by error number."""


def join_sentences(*parts: str) -> str:
    """Join a finding and its remedies, each as a sentence with its full stop; a single part stays as it is.

    >>> join_sentences("The port is in use", "Close the other program"), join_sentences("no such file", "")
    ('The port is in use. Close the other program.', 'no such file')
    """
    present = [part for part in parts if part]
    if len(present) < 2:
        return "".join(present)
    return " ".join(part if part[-1] in ".!?" else f"{part}." for part in present)


class DeviceError(OSError):
    """Raised if the DAQ cannot be reached or has stopped."""

    def __init__(self, text: str, cure: str = "") -> None:
        """Make an error of a device; str() gives text and cure.

        Parameters
        ----------
        text
            Finding without a full stop.
        cure
            Remedy; empty if unknown.
        """
        super().__init__(join_sentences(text, cure))
        self.text = text
        """Problem, without a full stop."""
        self.cure = cure
        """Remedy; empty if unknown."""


class DataError(ValueError):
    """Raised if a file cannot be used for a tap test."""


def format_error(error: Exception) -> str:
    """Return any error as a sentence without passwords, with its type if it is unexpected."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return hide_passwords(format_os_error(error))
    if isinstance(error, (ValueError, OSError, ArithmeticError)):
        return hide_passwords(str(error))
    return f"unexpected {type(error).__name__}: {hide_passwords(str(error))}"


def format_os_error(error: OSError) -> str:
    """Return an error of the operating system as a sentence: place, reason and remedy."""
    failure = f"{error.filename or 'the disk'}: {error.strerror or error}"
    cure = REMEDY_BY_ERRNO.get(error.errno or 0, "")
    return join_sentences(failure, cure)


CONTROL_CHARACTERS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
"""Control characters (ESC, NUL, newline, tab ...), line separators, and halves of characters that no text can hold."""


def check_name(name: str, what: str) -> None:
    """Check a name that a user gives: control characters steer a terminal or end a line.

    Parameters
    ----------
    name
        Name to check.
    what
        Kind of the name, for the message.

    Raises
    ------
    ValueError
        If the name holds a control character.
    """
    found = CONTROL_CHARACTERS.search(name)
    if found is not None:
        cure = "Use letters, digits, signs and spaces only."
        raise ValueError(f"{what}={name!r} contains the control character {found[0]!r}. {cure}")


@dataclass(frozen=True)
class Remark:
    """One thing to know about a result. Programs read `code` and `about`; `text` and `cure` are for people.

    Examples
    --------
    >>> remark = Remark("swept", "A", "the spindle sweeps 40 Hz", "tap it warm")
    >>> remark.finding, remark.code
    ('A: the spindle sweeps 40 Hz', 'swept')
    """

    code: str
    """Kind of remark: words in lower case joined by hyphens, listed in docs/remarks.md, never changed."""
    about: str
    """Subject of the remark: a program, a tap test, a mode ("1713 Hz"), a channel, a file; empty for the whole."""
    text: str
    """Finding, with figures and units, without a full stop."""
    cure: str = ""
    """Remedy; empty if none is needed or possible."""

    def __str__(self) -> str:
        return join_sentences(self.finding, self.cure)

    @property
    def finding(self) -> str:
        """Subject and text without the cure."""
        return ": ".join(filter(None, (self.about, self.text)))


def merge_remarks(remarks: Iterable[Remark]) -> list[Remark]:
    """Merge remarks that differ only in their subject.

    Parameters
    ----------
    remarks
        Remarks to merge.

    Returns
    -------
    list of Remark
        Merged remarks, in the order of the first of each.

    Examples
    --------
    >>> remarks = [Remark("small", program, "it is small") for program in ("A", "B")]
    >>> [(remark.code, remark.about) for remark in merge_remarks(remarks)]
    [('small', 'A, B')]
    >>> remarks = [Remark("small", series, "it is small") for series in ("T1, x", "T1, y")]
    >>> [remark.about for remark in merge_remarks(remarks)]
    ['T1, x and y']
    """
    about: dict[Remark, list[str]] = {}
    for remark in remarks:
        about.setdefault(replace(remark, about=""), []).append(remark.about)
    return [replace(first, about=_join_subjects(filter(None, names))) for first, names in about.items()]


def _join_subjects(names: Iterable[str]) -> str:
    """Join subjects; those that differ only after their last comma are one."""
    ends: dict[str, list[str]] = {}
    for name in dict.fromkeys(names):
        begin, comma, end = name.rpartition(", ")
        ends.setdefault(begin + comma, []).append(end)
    return ", ".join(begin + (" and " if begin else ", ").join(parts) for begin, parts in ends.items())
