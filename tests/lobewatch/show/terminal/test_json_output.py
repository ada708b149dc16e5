"""Test JSON objects: order of attributes, missing records, arrays."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition import Remark
from lobewatch.show.terminal.output import emit, pick

pytestmark = pytest.mark.quick


def test_picked_attributes_keep_the_order_of_their_names() -> None:
    record = SimpleNamespace(depth=0.002, tool="A", teeth=4)
    assert list(pick(record, "tool", "depth").items()) == [("tool", "A"), ("depth", 0.002)]


def test_without_a_record_every_attribute_is_none() -> None:
    assert pick(None, "tool", "depth") == {"tool": None, "depth": None}


def test_an_unknown_attribute_is_an_error() -> None:
    with pytest.raises(AttributeError):
        pick(SimpleNamespace(depth=1.0), "speed")


def test_records_and_arrays_become_objects_and_lists(capsys: pytest.CaptureFixture[str]) -> None:
    emit({"remarks": (Remark("code", "A", "text"),), "values": np.array([1.0, np.nan])}, as_json=True)
    shown = json.loads(capsys.readouterr().out)
    assert shown["remarks"] == [{"code": "code", "about": "A", "text": "text", "cure": ""}]
    assert shown["values"] == [1.0, None]
