"""Cutting programs judged over what is not known: doubt, draws, verdict, and settings that are safe."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
