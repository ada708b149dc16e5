"""Milling stability: lobes, stable pockets, published cutting data and SLD history."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
