"""Boards that print their samples as lines of text or simple frames: decoders, source, emulator."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
