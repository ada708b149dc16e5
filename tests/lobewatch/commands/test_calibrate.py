"""`lobewatch calibrate` with frequencies: bearings, another mode, groups, dampers, and rejected input."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dsm import natural_frequencies
from lobewatch.machine.folder import MachineFolder
from tests.lobewatch.commands.conftest import Run, refused


def test_calibrate(run: Run, trial: MachineFolder) -> None:
    said = run("calibrate", "trial", "--frequency", 1550, "--frequency-std", 0.4, "--json").json
    assert said["bearing_stiffness_n_per_m"] == pytest.approx(6.863e8, rel=1e-4)
    assert said["bearing_stiffness_n_per_m_std"] == pytest.approx(0.4 / 1550 / said["sensitivity"] * 6.863e8, rel=1e-3)
    assert "686" in run("calibrate", "trial", "--frequency", 1550).out
    refused(run("calibrate", "trial", "--frequency", 2500), "2500", "2301.1 Hz")
    refused(run("calibrate", "trial", "--frequency", -1), "-1")
    dampers = run("calibrate", "trial", "--frequency", 1713.05, "--damping-ratio", 0.03, "--json").json
    assert dampers["bearing_damping_n_s_per_m"] > 0
    assert "damping" in run("calibrate", "trial", "--frequency", 1713.05, "--damping-ratio", 0.03).out
    refused(run("calibrate", "trial", "--frequency", 1713.05, "--damping-ratio", 0.9), "0.9")
    twice = ("--frequency-std", 1, "--frequency-std", 2)
    refused(run("calibrate", "trial", "--frequency", 1550, *twice), "2 --frequency-std for 1 --frequency")
    refused(run("calibrate", "trial", "--frequency", 1550, "--mode", 1, "--mode", 2), "2 --mode for 1 --frequency")
    refused(run("calibrate", "trial", "--frequency", 1550, "--frequency", 1e9), "mode 2", "1e+09 Hz")
    refused(run("calibrate", "trial", "--frequency", 1e11), "1000 elements")
    run("init", "plain")
    refused(run("calibrate", "plain", "--frequency", 1550), "[spindle]")


def test_calibrate_by_another_mode_than_that_of_the_machine(run: Run, trial: MachineFolder) -> None:
    drawn = trial.machine.model("reference")
    worn = replace(drawn, bearings=[replace(b, stiffness=0.7 * b.stiffness) for b in drawn.bearings])
    third = natural_frequencies(worn, 3)[2]
    said = run("calibrate", "trial", "--frequency", third, "--mode", 3, "--frequency-std", 0.5, "--json").json
    assert said["bearing_stiffness_n_per_m"] == pytest.approx(0.7 * drawn.bearings[0].stiffness, rel=1e-6)
    assert said["bearing_stiffness_n_per_m_std"] > 0


def test_calibrate_groups(run: Run, trial: MachineFolder) -> None:
    toml = trial.toml.read_text("utf-8")
    for position, group in ((166, "front"), (203.5, "front"), (241, "front")):
        toml = toml.replace(f"position_mm = {position} ", f'position_mm = {position}, group = "{group}" ')
    trial.toml.write_text(toml, "utf-8")
    drawn = trial.machine.model("reference")
    worn = replace(
        drawn,
        bearings=[replace(b, stiffness=b.stiffness * (0.5 if b.group == "front" else 0.8)) for b in drawn.bearings],
    )
    measured = [word for f in natural_frequencies(worn, 4) for word in ("--frequency", f)]
    said = run("calibrate", "trial", *measured, "--group", "front", "--group", "bearings", "--json").json
    assert said["factor"] == pytest.approx([0.5, 0.8], rel=1e-6)
    assert "front" in run("calibrate", "trial", *measured).out
    front = replace(
        drawn, bearings=[replace(b, stiffness=(0.5 if b.group == "front" else 1) * b.stiffness) for b in drawn.bearings]
    )
    said = run("calibrate", "trial", "--frequency", natural_frequencies(front, 1)[0], "--group", "front", "--json").json
    assert said["bearing_stiffness_n_per_m"] == pytest.approx(0.5 * drawn.bearings[0].stiffness, rel=1e-6)
    refused(run("calibrate", "trial", *measured, "--group", "tail"), "tail", "front")
