"""One month of the demo, tapped in x and y on the Cortex-M3 of QEMU: results against the emulated truth."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import HammeredStructure, Hammering
from acquisition.emulation import quantise
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.demo import compare_with_truth, plan_taps
from lobewatch.tap.emulated_spindle import (
    EMULATED_CHANNELS,
    EMULATED_SAMPLE_RATE,
    MountingVariation,
    SpindleWear,
    WearScenario,
)
from lobewatch.tap.session import plan_session

SECONDS = 30.0
MONTH = 18
"""Month of the demo, of 24."""


def test_a_month_of_the_demo_is_found_as_it_was_emulated(switched_on: Callable[..., Any], tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    folder = MachineFolder(tmp_path / "m")
    random = np.random.default_rng(1)
    wear = SpindleWear.of(folder, 24, WearScenario.STEADY)
    plans = plan_taps(folder, wear, random, MountingVariation(0.001), datetime.now(UTC))[2 * MONTH : 2 * MONTH + 2]
    taken = []
    for plan, hammering in zip(plans, random.spawn(2), strict=True):
        tapper = HammeredStructure(plan.structure, EMULATED_SAMPLE_RATE, hammering, Hammering())
        codes = quantise(tapper(0, round(SECONDS * EMULATED_SAMPLE_RATE)), EMULATED_CHANNELS)
        with switched_on("qemu", codes) as board:
            taken.append((plan, plan_session(folder, port=board.port, direction=plan.direction).run().id))
    logbook = Logbook(folder)
    assert [plan.direction for plan in plans] == ["x", "y"]
    for tap in compare_with_truth(logbook, taken):
        frequency, damping, stiffness, bearing = map(abs, tap.result.relative_to(tap.plan.truth))
        assert frequency < 5e-5
        assert damping < 2e-3
        assert stiffness < 2e-3
        assert bearing < 5e-4
    assert {verdict.stability for verdict in logbook.verdicts()} <= {"stable", "doubtful", "not stable"}
