"""A tool in the spindle as it was tapped: its series, its mounting, x and y together, a prediction, its lobes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
