"""Emulated devices: hammered structure, milling cut, signal function, wire and server thread."""

from .emulated_device import (
    EmulationSetup,
    EmulatorThread,
    PtyWire,
    SignalFunction,
    SimulatedSource,
    TcpWire,
    quantise,
)
from .hammered_structure import HammeredStructure, Hammering, Structure
from .housing_signal import Housing, HousingSignal, make_random_housing, sample_housing
from .milling import TipMotion, simulate_cut, simulate_cuts
from .milling_cut import MillingCut, Passage

__all__ = [
    "EmulationSetup",
    "EmulatorThread",
    "HammeredStructure",
    "Hammering",
    "Housing",
    "HousingSignal",
    "MillingCut",
    "Passage",
    "PtyWire",
    "SignalFunction",
    "SimulatedSource",
    "Structure",
    "TcpWire",
    "TipMotion",
    "make_random_housing",
    "quantise",
    "sample_housing",
    "simulate_cut",
    "simulate_cuts",
]
