"""Boards that print their samples as lines of text or simple frames: decoders, source, emulator."""
