"""From an FRF to natural frequencies, damping ratios and stiffnesses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
