"""Devices read through a library of their vendor: USB audio, NI, Measurement Computing, LabJack."""
