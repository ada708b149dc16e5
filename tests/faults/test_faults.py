"""No loss of announced data after a failed file call, a killed program or a power cut: docs/studies/reliability.md."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faulty_files import FAULTS
from power_loss import WAYS
from tap_rounds import BEAM, CHANNELS, RATE

from acquisition import HammeredStructure, Hammering, TapsEmulator

HERE = Path(__file__).parent
Round = dict[str, Any]


def rounds_of(program: str, *arguments: object) -> list[Round]:
    line = [sys.executable, str(HERE / program), *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def wrong(rounds: list[Round]) -> list[Round]:
    return [one for one in rounds if one["wrong"]]


def killed(path: Path, how: str, rounds: int, seed: int) -> list[Round]:
    """Return rounds of the real command on an emulated streaming device."""
    signal = HammeredStructure(BEAM, RATE, np.random.default_rng(seed), Hammering())
    with TapsEmulator(signal, CHANNELS, RATE, realtime=False) as device:
        return rounds_of("tap_kills.py", path, device.port, how, rounds, seed)


@pytest.mark.timeout(600)
def test_one_fault_in_twenty_three_at_a_file_call_costs_nothing(tmp_path: Path) -> None:
    rounds = rounds_of("tap_rounds.py", tmp_path, "faults", 23, 3)
    assert wrong(rounds) == []
    assert len(rounds) >= 15
    assert {one["fault"] for one in rounds} >= set(FAULTS) - {"killed half-way"}
    assert sum(bool(one["told"]) for one in rounds) >= 4


@pytest.mark.timeout(600)
def test_one_power_cut_in_twenty_three_costs_nothing(tmp_path: Path) -> None:
    rounds = rounds_of("tap_rounds.py", tmp_path, "power", 23, 0)
    assert wrong(rounds) == []
    assert {one["fault"] for one in rounds} == {f"power cut, {way}" for way in WAYS}


@pytest.mark.timeout(600)
def test_twenty_kills_of_the_command_cost_nothing(tmp_path: Path) -> None:
    rounds = killed(tmp_path / "m", "forked", 20, 1)
    assert wrong(rounds) == []
    assert rounds[-1]["ended"] == 0
    assert rounds[-1]["saved"]
    assert sum(one["ended"] == -9 for one in rounds) >= 15
    assert sum(one["hits"] > 0 and not one["saved"] for one in rounds) >= 3


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_every_fault_at_every_file_call_costs_nothing(tmp_path: Path) -> None:
    rounds = rounds_of("tap_rounds.py", tmp_path, "faults", 1, 0)
    count = Counter(one["fault"] for one in rounds)
    assert wrong(rounds) == []
    assert min(count[fault] for fault in FAULTS if fault != "killed half-way") >= 70


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_every_power_cut_costs_nothing(tmp_path: Path) -> None:
    rounds = rounds_of("tap_rounds.py", tmp_path, "power", 1, 0)
    assert wrong(rounds) == []
    assert len(rounds) >= 230


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_two_hundred_kills_of_the_command_cost_nothing(tmp_path: Path) -> None:
    rounds = killed(tmp_path / "m", "started", 200, 2)
    assert wrong(rounds) == []
    assert sum(one["ended"] == -9 for one in rounds) >= 150
