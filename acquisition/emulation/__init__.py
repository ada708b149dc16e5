"""What an emulated device is made of: a hammered structure, a wire, a thread that serves it."""

from acquisition.emulation.bench import Bench
from acquisition.emulation.hammered_structure import HammeredStructure, Hammering, Structure
from acquisition.emulation.simulated_source import Signal, SimulatedSource, quantise
from acquisition.emulation.thread import EmulatorThread
from acquisition.emulation.wire import PtyWire, TcpWire, Wire

__all__ = [
    "Bench",
    "EmulatorThread",
    "HammeredStructure",
    "Hammering",
    "PtyWire",
    "Signal",
    "SimulatedSource",
    "Structure",
    "TcpWire",
    "Wire",
    "quantise",
]
