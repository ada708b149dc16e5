"""Recorded files as tap tests of a machine: found in folders, dated, understood, shown or stored."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
