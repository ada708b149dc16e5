"""The operator's screen in a browser: pages that follow a tap test and a cut, and a dashboard of machines."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
