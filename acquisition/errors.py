"""What can go wrong in the world outside: devices and files. Misuse raises the built-in ValueError.

OSError
└── DeviceError     no device, a port in use, an unplugged cable, a device that falls silent
ValueError
└── DataError       a file that cannot be used, with the place and what to do
"""

from __future__ import annotations

import errno

NOT_ALLOWED = (errno.EACCES, errno.EPERM, errno.EROFS)
"""Errors of a place that can only be read, or not even that."""
ROOM = "make room on that disk"
DESCRIPTORS = "close other programs, too many files are open"
CURES = {
    errno.ENOSPC: ROOM,
    errno.EDQUOT: ROOM,
    errno.EMFILE: DESCRIPTORS,
    errno.ENFILE: DESCRIPTORS,
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


def failure_text(error: Exception) -> str:
    """Any error in a sentence; the kind of one that nobody has foreseen, too."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return system_failure(error)
    if isinstance(error, (ValueError, OSError, ArithmeticError)):
        return str(error)
    return f"{type(error).__name__}, which should not be: {error}"


def system_failure(error: OSError) -> str:
    """An error of the operating system in a sentence: where, what, and what to do where that is known."""
    failure = f"{error.filename or 'the disk'}: {error.strerror or error}"
    cure = CURES.get(error.errno or 0, "")
    return f"{failure}; {cure}" if cure else failure
