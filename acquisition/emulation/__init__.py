"""What an emulated device is made of: a hammered structure or a milling cut, a wire, a thread that serves it."""

from acquisition.emulation.bench import Bench
from acquisition.emulation.hammered_structure import HammeredStructure, Hammering, Structure
from acquisition.emulation.milling import TipMotion, simulate_cut, simulate_cuts
from acquisition.emulation.milling_cut import MillingCut, Passage
from acquisition.emulation.milling_housing import CutSound, Housing, hear, random_housing
from acquisition.emulation.simulated_source import Signal, SimulatedSource, quantise
from acquisition.emulation.thread import EmulatorThread
from acquisition.emulation.wire import PtyWire, TcpWire, Wire

__all__ = [
    "Bench",
    "CutSound",
    "EmulatorThread",
    "HammeredStructure",
    "Hammering",
    "Housing",
    "MillingCut",
    "Passage",
    "PtyWire",
    "Signal",
    "SimulatedSource",
    "Structure",
    "TcpWire",
    "TipMotion",
    "Wire",
    "hear",
    "quantise",
    "random_housing",
    "simulate_cut",
    "simulate_cuts",
]
