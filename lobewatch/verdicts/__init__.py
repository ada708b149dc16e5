"""What a tool allows: doubt, word and limit of each program, why, and settings that would be safe."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
