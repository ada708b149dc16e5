"""`lobewatch calibrate --tool A --tool B`: joint and bearings from tap tests of two tools, and rejected input."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import Result

from acquisition import Circumstances, DataError, Frf, TapTest, new_tap_id
from dsm import Spindle, modes_at, receptance
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from tests.lobewatch.commands.invoke import invoke

LINES = np.arange(4.0, 6000.0, 4.0)
LOSS = 0.058
JOINT = """joints = [
    { position_mm = 93.5, stiffness_n_per_um = 1000, rotational_stiffness_n_m_per_rad = 2e5, group = "holder" },
]
bearings = ["""
SHORT = """
[[tool]]
name = "short"
segments = [{ length_mm = 20.0, outer_mm = 18.0, material = "carbide" }, { length_mm = 30.0, outer_mm = 32.0 }]
"""
LONG = "long end mill"


def worn(folder: MachineFolder, tool: str, bearings: float = 0.8) -> Spindle:
    """Return the true spindle: other bearings, a joint half as stiff radially and 1.7 times as stiff in tilting."""
    drawn = folder.machine.model(tool)
    joints = [
        replace(one, stiffness=0.5 * one.stiffness, rotational_stiffness=1.7 * one.rotational_stiffness)
        for one in drawn.joints
    ]
    softened = [replace(one, stiffness=bearings * one.stiffness) for one in drawn.bearings]
    return replace(drawn, bearings=softened, joints=joints)


def tap(folder: MachineFolder, tool: str, day: int, bearings: float = 0.8) -> None:
    """Make a tap test without noise; the shift of poles by structural damping is compensated."""
    lines = LINES * (1 + LOSS**2) ** 0.25
    frf = Frf(LINES, receptance(worn(folder, tool, bearings), lines, loss_factor=LOSS), np.full(LINES.size, 0.9999), 10)
    about = Circumstances("m", datetime(2026, 3, day, tzinfo=UTC), tool, "x", "", folder.toml.read_text("utf-8"))
    folder.commit(TapTest(id=new_tap_id(about), circumstances=about, frf=frf))


def machine(path: Path) -> MachineFolder:
    """Make the example machine with a joint behind its tool and a third tool."""
    make_machine_folder(path, "surrogate_machine.toml")
    toml = path / "machine.toml"
    text = toml.read_text("utf-8").replace("bearings = [", JOINT, 1).replace("[1200, 2200]", "[300, 5800]")
    toml.write_text(text + SHORT, "utf-8")
    return MachineFolder(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> MachineFolder:
    """Two of its three tools were tapped."""
    made = machine(tmp_path_factory.mktemp("tools") / "m")
    tap(made, "reference", 1)
    tap(made, LONG, 2)
    return MachineFolder(made.path)


def run(folder: MachineFolder, *arguments: object) -> Result:
    words = ["calibrate", str(folder.path), *map(str, arguments)]
    return invoke(words)


def two(folder: MachineFolder, *arguments: object) -> Result:
    return run(folder, "--tool", "reference", "--tool", LONG, *arguments)


def test_two_tools_find_joint_and_bearings_and_predict_a_third(folder: MachineFolder) -> None:
    told = two(folder, "--json")
    assert told.exit_code == 0
    found: dict[str, Any] = json.loads(told.stdout)
    assert found["groups"] == ["bearings", "holder", "holder tilting"]
    assert found["stiffness_n_per_m"] == pytest.approx([0.8 * 1280e6, 0.5 * 1e9, 1.7 * 2e5], rel=5e-3)
    assert sorted(zip(found["tool"], found["mode"], strict=True))[:3] == [(LONG, 1), (LONG, 2), (LONG, 3)]
    frequency, stiffness = (float(one[0]) for one in modes_at(worn(folder, "short"), 1))
    third = found["predicted"]["short"]
    assert third["frequency"] == pytest.approx(frequency, rel=1e-3)
    assert third["stiffness"] == pytest.approx(stiffness, rel=5e-3)
    assert 0 < third["frequency_std"] < 0.03 * frequency
    assert found["fits_one_spindle"]
    assert any("stiffness_n_per_um = 500" in line for line in found["machine_toml"])


def test_what_is_to_be_entered_is_valid_and_in_the_places_of_machine_toml(folder: MachineFolder) -> None:
    text = run(folder, "--tool", LONG, "--tool", "reference").stdout
    start = text.index("joints = [")
    lines = text[start : text.index("]\n", start) + 1]
    assert "position_mm = 93.5" in lines
    old = (folder.path / "machine.toml").read_text("utf-8")
    entered = old.replace(JOINT.removesuffix("\nbearings = ["), lines)
    assert entered != old
    other = folder.path.parent / "entered"
    other.mkdir()
    (other / "machine.toml").write_text(entered, "utf-8")
    joint = MachineFolder(other).machine.model("reference").joints[0]
    assert joint.rotational_stiffness == pytest.approx(1.7 * 2e5, rel=5e-3)


def test_tools_of_two_spindles_are_reported_and_nothing_is_to_be_entered(tmp_path: Path) -> None:
    made = machine(tmp_path / "m")
    tap(made, "reference", 1)
    tap(made, LONG, 2, bearings=0.7)
    told = two(MachineFolder(made.path))
    assert told.exit_code == 1
    assert "machine.toml" in told.stdout.splitlines()[-1]
    assert "joints = [" not in told.stdout


def test_too_few_modes_share_factors_and_predict_nothing(tmp_path: Path) -> None:
    made = machine(tmp_path / "m")
    toml = made.path / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace("[300, 5800]", "[300, 2000]"), "utf-8")
    for day, tool in enumerate(("reference", LONG), 1):
        tap(MachineFolder(made.path), tool, day)
    found = json.loads(two(MachineFolder(made.path), "--json").stdout)
    assert found["groups"] == ["bearings", "holder"]
    assert [one["code"] for one in found["remarks"]] == ["factors-shared"]
    assert found["predicted"] == {}
    assert found["residual_hz"] == pytest.approx([0, 0], abs=1e-6)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--tool", LONG], "two"),
        (["--tool", LONG, "--tool", LONG], "2 times"),
        (
            ["--tool", LONG, "--tool", "short"],
            "'short'.* x.*long end mill",
        ),
        (["--tool", LONG, "--tool", "drill"], "'drill'"),
        (["--tool", LONG, "--tool", "reference", "--direction", "y"], "direction y"),
        (
            ["--tool", LONG, "--tool", "reference", "--frequency", "1550"],
            "--tool.*--frequency",
        ),
        (["--tool", LONG, "--tool", "reference", "--mode", "1"], "1 --mode for 2 --tool"),
        ([], "--frequency.*--tool"),
    ],
)
def test_bad_input_is_rejected_in_a_sentence(folder: MachineFolder, options: list[str], said: str) -> None:
    with pytest.raises((ValueError, DataError), match=said):
        run(folder, *options)


def test_without_a_joint_that_has_a_group_nothing_can_be_found(tmp_path: Path) -> None:
    made = machine(tmp_path / "m")
    toml = made.path / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace(', group = "holder"', ""), "utf-8")
    with pytest.raises(DataError, match=r"joint.*group"):
        two(MachineFolder(made.path))
