"""Test tables of JSON keys: order, units, missing parts, and mistakes in a table."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition import Remark
from lobewatch.show.terminal.output import emit, json_fields

pytestmark = pytest.mark.quick


def test_keys_keep_the_order_of_the_table_and_take_their_units() -> None:
    record = SimpleNamespace(depth=0.002, force=3e6, tool=SimpleNamespace(name="A"))
    fields = json_fields("kt_n_per_mm2=force/1e6 tool=tool.name depth depth_mm=depth*1e3")
    assert list(fields(record).items()) == [("kt_n_per_mm2", 3.0), ("tool", "A"), ("depth", 0.002), ("depth_mm", 2.0)]


def test_a_missing_part_of_a_path_is_none() -> None:
    assert json_fields("f_hz=mode.frequency*1.0")(SimpleNamespace(mode=None)) == {"f_hz": None}


def test_an_unknown_attribute_is_an_error() -> None:
    with pytest.raises(AttributeError):
        json_fields("speed")(SimpleNamespace(depth=1.0))


def test_a_mistake_in_a_table_is_an_error() -> None:
    with pytest.raises(ValueError, match="no key"):
        json_fields("speed=rpm+1")


def test_records_and_arrays_become_objects_and_lists(capsys: pytest.CaptureFixture[str]) -> None:
    emit({"remarks": (Remark("code", "A", "text"),), "values": np.array([1.0, np.nan])}, as_json=True)
    shown = json.loads(capsys.readouterr().out)
    assert shown["remarks"] == [{"code": "code", "about": "A", "text": "text", "cure": ""}]
    assert shown["values"] == [1.0, None]
