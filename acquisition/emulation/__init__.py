"""Emulated devices: hammered structure, milling cut, signal function, wire and server thread."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
