"""Fleet of machines: status and summary of each, and the tap tests of all as one table."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
