"""The history of a machine: a row for each tap test, its place on the disk, what still holds, damage met once."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
