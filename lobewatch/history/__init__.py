"""History of a machine: a row for each tap test, its cache on the disk, and its export."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
