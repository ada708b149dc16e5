"""Devices that a library of their maker reads: USB audio, NI, Measurement Computing, LabJack."""

from acquisition.makers.audio import open_audio, search_audio
from acquisition.makers.library_device import LibraryDevice, Piece, Reader
from acquisition.makers.ljm import open_ljm, search_ljm
from acquisition.makers.mcc172 import open_mcc172, search_mcc172
from acquisition.makers.name_calibration import NameCalibration, calibration_in
from acquisition.makers.nidaqmx import open_nidaqmx, search_nidaqmx
from acquisition.makers.uldaq import open_uldaq, search_uldaq

__all__ = [
    "LibraryDevice",
    "NameCalibration",
    "Piece",
    "Reader",
    "calibration_in",
    "open_audio",
    "open_ljm",
    "open_mcc172",
    "open_nidaqmx",
    "open_uldaq",
    "search_audio",
    "search_ljm",
    "search_mcc172",
    "search_nidaqmx",
    "search_uldaq",
]
