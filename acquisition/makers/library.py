"""The library of a maker, imported when it is needed."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from acquisition.errors import DeviceError


def load_library(module: str, extra: str) -> Any:  # a module without types
    """A module of a library; DeviceError with the command that installs it where it cannot be imported.

    OSError is what libraries raise whose own C library is missing.
    """
    try:
        return import_module(module)
    except (ImportError, OSError) as error:
        package = module.partition(".")[0]
        raise DeviceError(
            f"the library {package} cannot be used ({' '.join(str(error).split())})",
            f"pip install 'lobewatch[{extra}]', and what its maker says it needs (docs/devices.md)",
        ) from error


def installed_library(module: str, extra: str) -> Any | None:  # as above
    """The same for a search; None where it cannot be imported."""
    try:
        return load_library(module, extra)
    except DeviceError:
        return None


def only_inputs(numbers: Sequence[int], count: int, device: str) -> None:
    """ValueError for an input that a device does not have."""
    for number in numbers:
        if number >= count:
            raise ValueError(f"input={number}: {device} has the inputs 0 to {count - 1}; correct [[daq.channel]]")
