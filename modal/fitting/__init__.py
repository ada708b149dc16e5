"""Least squares of a few neighbouring modes at once, in one FRF or in several with the same poles."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
