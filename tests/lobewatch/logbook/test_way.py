"""A question goes a short way: from the command that asks it to the measurement of a tap test."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.measurement.tap_measurement import Measurement, measure

MOST_CHANGES = 7
"""Changes of file between them, at most."""
Shop = Any
"""Machine of tests/lobewatch/conftest.py."""


@pytest.mark.parametrize("command", ["check", "trend", "lobes"])
def test_a_command_is_few_files_from_the_measurement(shop: Shop, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    ways = list[list[str]]()

    def measured(*arguments: Any) -> Measurement:
        files = [Path(frame.filename) for frame in reversed(inspect.stack())]
        names = [file.name for file in files if "lobewatch" in file.parts and "tests" not in file.parts]
        ways.append([name for name, before in zip(names, ["", *names], strict=False) if name != before])
        return measure(*arguments)

    shop.tap_both()
    monkeypatch.setattr("lobewatch.history.tap_measurements.measure", measured)
    result = CliRunner().invoke(app, [command, str(shop.path), "--json"], catch_exceptions=False)
    assert json.loads(result.stdout)
    for way in ways:
        assert way[-1] == "tap_measurements.py"
        assert len(way) - way.index(f"{command}.py") <= MOST_CHANGES, way  # with the one that leads into measure itself
    assert len(ways) == 2
