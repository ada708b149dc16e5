"""Many machines at once: how each stands, small and quick to read, and the tap tests of all as one table."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
