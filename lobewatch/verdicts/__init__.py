"""Verdicts on cutting programs: uncertainty, stability and limits, and settings that would be stable."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
