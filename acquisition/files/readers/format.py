"""What makes a kind of recorded file readable: a record, not a base class."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from acquisition.files.contents.contents import Contents
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap import Circumstances


def _says_nothing(_path: Path) -> None:
    """Of when, where and by whom it was recorded."""


@dataclass(frozen=True)
class Format:
    """One kind of recorded file. Its functions raise DataError, with the path and the place, for a damaged one."""

    name: str
    """Short name, in lower case, of its own among all formats."""
    title: str
    """Name for people."""
    extensions: tuple[str, ...]
    """Endings that names of such files mostly have, with the dot: for messages, and for what of a folder is read at
    all."""
    is_it: Callable[[bytes, Path], bool]
    """Whether a file is of this kind, from its first 4096 bytes (it has at least one) and, where need be, all of it."""
    read: Callable[[Path], Contents | list[Hit] | Frf]
    """Function that reads it: its contents, or hits in SI units, at least one, or an FRF, where the format leaves
    nothing open."""
    recorded_as: Callable[[Path], Circumstances | None] = _says_nothing
    """Function that reads when, where and by whom it was recorded, beside its Contents; None where it says nothing."""
    read_frf: Callable[[Path], Frf] | None = None
    """Function that reads the FRF it holds beside its hits; None where that is to be estimated from them."""
    read_from: Callable[[Path, int, str], Contents] | None = None
    """Function that reads it behind some first lines, with a decimal sign (empty where nobody says it); None where it
    is not a text of lines."""
