"""Recorded files as tap tests of a machine: find, read, prepare and store them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
