"""Milling stability: lobes from modes or FRFs, stable pockets, published cutting data, and a history of lobes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
