"""How a series of tap tests decays: points, alarm, forecast; arrays in, records out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
