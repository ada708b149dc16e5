"""Devices read through a library of their vendor: USB audio, NI, Measurement Computing, LabJack."""

from acquisition.vendor_drivers.audio import NameCalibration, open_audio, parse_name_calibration, search_audio
from acquisition.vendor_drivers.labjack import open_ljm, search_ljm
from acquisition.vendor_drivers.library_device import LibraryDevice, LibraryReader, VoltageBlock
from acquisition.vendor_drivers.measurement_computing import open_mcc172, open_uldaq, search_mcc172, search_uldaq
from acquisition.vendor_drivers.nidaqmx import open_nidaqmx, search_nidaqmx

__all__ = [
    "LibraryDevice",
    "LibraryReader",
    "NameCalibration",
    "VoltageBlock",
    "open_audio",
    "open_ljm",
    "open_mcc172",
    "open_nidaqmx",
    "open_uldaq",
    "parse_name_calibration",
    "search_audio",
    "search_ljm",
    "search_mcc172",
    "search_nidaqmx",
    "search_uldaq",
]
