"""Drivers of DATAQ devices: protocol, stream decoder, source and emulator."""
