"""Measurement of one tap test or recorded file: modes, followed mode, calibrated model, questions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
