"""Least-squares fit of a few neighbouring modes in one FRF, or in several with common poles."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
