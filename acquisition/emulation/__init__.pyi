"""What an emulated device is made of: a hammered structure or a milling cut, a wire, a thread that serves it."""

from .bench import Bench
from .hammered_structure import HammeredStructure, Hammering, Structure
from .milling import TipMotion, simulate_cut, simulate_cuts
from .milling_cut import MillingCut, Passage
from .milling_housing import CutSound, Housing, hear, random_housing
from .simulated_source import Signal, SimulatedSource, quantise
from .thread import EmulatorThread
from .wire import PtyWire, TcpWire, Wire

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
