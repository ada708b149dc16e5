"""Boards that print their samples, as lines of text or as simple frames: format, source, probe, emulator."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
