"""Semi-discretisation of high order: milling over one tooth period, its largest multiplier, and the limits from it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
