"""What an emulated device is made of: a hammered structure or a milling cut, a wire, a thread that serves it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
