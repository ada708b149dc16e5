"""An HDF5 file in memory."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import h5py

HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of such a file."""


def hdf5_in(memory: io.BytesIO, mode: Literal["r", "r+", "w"]) -> h5py.File:
    """The file that these bytes are or become; OSError where they are none."""
    import h5py  # takes longer to import than what a command needs that opens no file

    return h5py.File(memory, mode)
