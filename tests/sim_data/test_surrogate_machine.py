"""The simulated machine: its file is valid, and its spindle has the frequencies of Gaber & Hashemi (2015)."""

from __future__ import annotations

from importlib import resources

import pytest

from dsm import natural_frequencies
from lobewatch.machine.settings.machine_file import parse_machine_file

pytestmark = pytest.mark.quick


def test_the_spindle_of_the_machine_file_has_the_frequency_of_the_paper() -> None:
    text = resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
    spindle = parse_machine_file(text).model("reference")
    assert natural_frequencies(spindle, 1)[0] == pytest.approx(1722.0, rel=0.01)
