"""Tool in the spindle: series of tap tests, assembly in x and y, prediction, and lobes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
