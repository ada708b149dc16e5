"""Condition monitoring of a series of tap tests: changes, alarms, forecasts, machine status."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
