"""The emulated spindle: the model's modes behind an emulated DAQ. Its truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition import (
    Channel,
    DataqEmulator,
    DataqInput,
    DataqTraits,
    HammeredStructure,
    Hammering,
    Structure,
    TapsEmulator,
)
from dsm import Spindle, modes_at, static_stiffness

MODES = 8
"""Modes integrated; the rest is their static flexibility."""
SAMPLE_RATE = 25600.0
"""Hz."""
CHANNELS = (
    Channel("force", sensitivity=2.25e-3, full_scale=5.0, calibration_date="2026-01-15"),
    Channel("acceleration", sensitivity=1.02e-3, full_scale=5.0, calibration_date="2026-01-15"),
)
"""A 2.2 kN hammer and a 500 g accelerometer on a 16-bit converter."""


def emulated_structure(spindle: Spindle, damping_ratio: float, position: float = 0.0) -> Structure:
    """What a hammer meets at a position (m from the tool tip): modes and static residual of the model."""
    frequency, stiffness = modes_at(spindle, MODES, position)
    return Structure(
        frequency=frequency,
        damping_ratio=np.full(MODES, damping_ratio),
        stiffness=stiffness,
        residual=1 / static_stiffness(spindle, position) - float(np.sum(1 / stiffness)),
    )


def with_bearing_stiffness(spindle: Spindle, stiffness: float) -> Spindle:
    """The spindle with every bearing at this stiffness (N/m)."""
    return replace(spindle, bearings=[replace(bearing, stiffness=stiffness) for bearing in spindle.bearings])


def emulator(structure: Structure, random: np.random.Generator, *, realtime: bool, tcp: bool = False) -> TapsEmulator:
    """Somebody taps this structure, again and again, on a TAPS/1 device."""
    signal = HammeredStructure(structure, SAMPLE_RATE, random, Hammering())
    return TapsEmulator(signal, CHANNELS, SAMPLE_RATE, realtime=realtime, tcp=tcp)


def dataq_emulator(
    structure: Structure,
    inputs: tuple[DataqInput, ...],
    random: np.random.Generator,
    *,
    realtime: bool,
    tcp: bool = False,
) -> DataqEmulator:
    """Somebody taps this structure, again and again, with these sensors on a DATAQ device.

    Where a skew is given for one of them, the device converts its inputs one after the other.
    """
    return DataqEmulator(
        lambda rate: HammeredStructure(structure, rate, random, Hammering()),
        inputs,
        realtime=realtime,
        tcp=tcp,
        traits=DataqTraits(scanned=any(one.channel.skew for one in inputs)),
    )
