"""Emulated TAPS/1 device on a structure that is tapped again and again."""

from __future__ import annotations

import numpy as np

from acquisition import HammeredStructure, Structure, TapsEmulator
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, EMULATED_SAMPLE_RATE


def make_emulator(structure: Structure, random: np.random.Generator, *, realtime: bool) -> TapsEmulator:
    """Make a device that is not served yet."""
    signal = HammeredStructure(structure, EMULATED_SAMPLE_RATE, random)
    return TapsEmulator(signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=realtime)
