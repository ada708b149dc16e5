"""Messages of device errors."""

from __future__ import annotations

import pytest

from acquisition import DeviceError

pytestmark = pytest.mark.quick


def test_cause_and_cure_of_a_device_error_are_reported_together_and_kept_apart() -> None:
    error = DeviceError("the DAQ was unplugged", "Plug it in")
    assert str(error) == "the DAQ was unplugged. Plug it in."
    assert (error.text, error.cure) == ("the DAQ was unplugged", "Plug it in")
    assert str(DeviceError("the DAQ was unplugged")) == "the DAQ was unplugged"
