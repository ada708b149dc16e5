"""From the DAQ to hits, averaged FRF and HDF5 files."""

from acquisition.channel import Block, Channel
from acquisition.check_hit import check_hit
from acquisition.estimate_frf import cross_spectra, estimate_frf
from acquisition.frf import Frf, from_accelerance
from acquisition.hit import Hit, HitFlags

__all__ = [
    "Block",
    "Channel",
    "Frf",
    "Hit",
    "HitFlags",
    "check_hit",
    "cross_spectra",
    "estimate_frf",
    "from_accelerance",
]
