"""The formats that can be read: our own and those of other packages (entry points in the group "lobewatch.formats")."""

from __future__ import annotations

import functools
import logging
import math
from importlib.metadata import entry_points
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.readers.format import Format
from acquisition.files.readers.read_arrays import FOREIGN_HDF5, NUMPY
from acquisition.files.readers.read_lvm import LVM
from acquisition.files.readers.read_mat import MAT
from acquisition.files.readers.read_pulse import PULSE
from acquisition.files.readers.read_sep005 import SEP005
from acquisition.files.readers.read_table import TEXT_TABLE
from acquisition.files.readers.read_tdms import TDMS
from acquisition.files.readers.read_uff import UFF
from acquisition.files.readers.read_wav import WAV
from acquisition.files.tap_recording import TAP_FILE
from acquisition.plugin import FAILURES, load_plugin, not_usable, package_of, words_of
from acquisition.regular_file import open_regular
from acquisition.remark import Remark

GROUP = "lobewatch.formats"
"""Entry points that each name one Format."""
BUILT_IN = (TAP_FILE, UFF, MAT, LVM, TDMS, WAV, SEP005, NUMPY, FOREIGN_HDF5, PULSE, TEXT_TABLE)
"""The table last: it takes any text."""
HEAD = 4096
"""Bytes at the start of a file that a format is asked with."""

_log = logging.getLogger(__name__)


def known_formats() -> tuple[Format, ...]:
    """All formats in the order in which they are asked: those of other packages, which know their own files, first."""
    return (*_of_others()[0], *BUILT_IN)


def format_of(path: Path) -> Format:
    """The format of a file by its content; DataError for one that is empty or of no known format."""
    with open_regular(path, math.inf) as file:
        head = file.read(HEAD)
    if not head:
        raise DataError(f"{path}: the file is empty")
    for file_format in known_formats():
        if _is_it(file_format, head, path):
            return file_format
    titles = ", ".join(f"{file_format.title} ({', '.join(file_format.extensions)})" for file_format in known_formats())
    raise DataError(f"{path}: of no format that is known here; export it as one of these: {titles}{broken_formats()}")


def broken_formats() -> str:
    """What is wrong with formats of other packages, to be added to the error of a file; empty where nothing is."""
    return "".join(f"; {fault}" for fault in _of_others()[1])


def _is_it(file_format: Format, head: bytes, path: Path) -> bool:
    try:
        return file_format.is_it(head, path)
    except FAILURES as error:  # code of others may raise anything; the other formats are asked still
        _log.warning("%r: format %r could not be asked (%s)", str(path), file_format.name, words_of(error))
        return False


@functools.cache
def _of_others() -> tuple[tuple[Format, ...], tuple[Remark, ...]]:
    """Formats of other packages, and a remark on each that cannot be used."""
    formats: dict[str, Format] = {}
    remarks: list[Remark] = []
    taken = {built_in.name for built_in in BUILT_IN}
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        plugin = load_plugin(point, Format)
        if isinstance(plugin, Format) and plugin.name not in taken | formats.keys():
            formats[plugin.name] = plugin
        elif isinstance(plugin, Format):
            remarks.append(not_usable(Format, point.name, f"{package_of(point)} is not the only one to bring it"))
        else:
            remarks.append(plugin)
    return tuple(formats.values()), tuple(remarks)
