"""Data of one machine: machine.toml, its folder, its journal and its DAQ."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
