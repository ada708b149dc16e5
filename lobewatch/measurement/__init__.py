"""One tap test or one recorded file to what it measures: modes, followed mode, calibrated model; questions; workers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
