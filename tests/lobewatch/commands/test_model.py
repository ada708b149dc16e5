"""`lobewatch model`: the newest bearings, another tool, and the picture."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import Circumstances, Frf, TapDirection, TapTest, new_tap_id
from dsm import modes_at, natural_frequencies, receptance
from lobes import lower_envelope, zero_order_lobes
from lobewatch.logbook import Logbook, collect_model_figure
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.settings.machine_file import REFERENCE_CUT
from lobewatch.measurement import build_model_state
from lobewatch.show.figures.spindle_figures import plot_model
from lobewatch.tool import speed_grid
from lobewatch.tool.assembly import predict_assembly
from lobewatch.verdicts import Stability
from modal import Mode
from tests.lobewatch.commands.invoke import invoke

TOOL = "long end mill"
EXAMPLE_PROGRAM = """
[[program]]
name = "long slot"
tool = "{tool}"
teeth = 4
tool_diameter_mm = 20
radial_depth_mm = 20
direction = "down"
tangential_n_per_mm2 = 1400
radial_n_per_mm2 = 500
speed_rpm = 9000
depth_mm = 0.3

"""
LINES = np.arange(2.0, 6000.0, 2.0)


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    """Make the surrogate machine with a band wide enough for the long tool."""
    make_machine_folder(tmp_path / "trial", "surrogate_machine.toml")
    toml = tmp_path / "trial" / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace("[1200, 2200]", "[800, 2200]"), "utf-8")
    return MachineFolder(tmp_path / "trial")


def bearing_stiffness(found: dict[str, Any]) -> float:
    """N/um, from the words of where it comes from."""
    return float(found["bearings_from"].split(": ")[1].split()[0])


def tapped(
    folder: MachineFolder, factor: float, tool: str = "reference", day: int = 1, direction: TapDirection = "x"
) -> TapTest:
    """Make a noiseless tap test of the model with its bearings softened by `factor`.

    Its damping is structural, which puts poles (1 + eta^2)^(1/4) above natural frequencies: the lines make up for it.
    """
    drawn = folder.machine.model(tool)
    worn = replace(drawn, bearings=[replace(b, stiffness=factor * b.stiffness) for b in drawn.bearings])
    time = datetime(2026, 3, day, tzinfo=UTC)
    about = Circumstances("trial", time, tool, direction, "", folder.toml.read_text("utf-8"))
    frf = Frf(
        LINES, receptance(worn, LINES * (1 + 0.058**2) ** 0.25, loss_factor=0.058), np.full(LINES.size, 0.9999), 10
    )
    return TapTest(id=new_tap_id(about), circumstances=about, frf=frf)


def said(*arguments: object) -> dict[str, Any]:
    result = invoke([*map(str, arguments), "--json"])
    assert result.exit_code == 0
    parsed: dict[str, Any] = json.loads(result.stdout)
    return parsed


def test_before_the_first_tap_it_is_the_model_as_drawn(folder: MachineFolder) -> None:
    found = said("model", folder.path, "--modes", 3)
    expected = natural_frequencies(folder.machine.model("reference"), 3)
    assert [mode["frequency_hz"] for mode in found["modes"]] == pytest.approx(expected)
    assert found["modes"][0]["modal_tip_stiffness_n_per_m"] == pytest.approx(3.5284e7, rel=1e-4)
    assert found["static_tip_stiffness_n_per_m"] == pytest.approx(2.9265e7, rel=1e-4)
    assert found["critical_speed_rpm"] == pytest.approx(60 * expected[0])
    assert found["first_frequency_with_rigid_bearings_hz"] == pytest.approx(2301.09, abs=0.01)
    assert found["bearings_from"].startswith("machine.toml")
    for mode in found["modes"]:
        parts = [mode[f"{part}_energy_share"] for part in ("bearing", "segment", "joint")]
        assert sum(parts) == pytest.approx(1)
        assert parts[2] == 0


def test_the_newest_tap_sets_the_bearings_of_every_tool(folder: MachineFolder) -> None:
    folder.commit(tapped(folder, 0.6))
    found = said("model", folder.path, "--tool", TOOL)
    drawn = folder.machine.model(TOOL)
    worn = replace(drawn, bearings=[replace(b, stiffness=0.6 * b.stiffness) for b in drawn.bearings])
    predicted = [mode["frequency_hz"] for mode in found["modes"]]
    assert predicted == pytest.approx(natural_frequencies(worn, 4), rel=1e-3)
    assert bearing_stiffness(found) == pytest.approx(768, rel=5e-3)


def test_a_tap_with_another_tool_is_calibrated_with_that_tools_model(folder: MachineFolder) -> None:
    folder.commit(tapped(folder, 0.7, TOOL))
    found = said("model", folder.path)
    assert bearing_stiffness(found) == pytest.approx(896, rel=5e-3)


@pytest.mark.parametrize("tool", [None, TOOL])
def test_the_picture_shows_the_shaft_the_curve_and_what_was_measured(folder: MachineFolder, tool: str | None) -> None:
    folder.commit(tapped(folder, 0.6))
    folder.commit(tapped(folder, 0.5, TOOL, day=2))
    logbook = Logbook(folder)
    state = build_model_state(folder.machine, logbook.calibrated_measurement, tool)
    picture = collect_model_figure(logbook, state, 4)
    assert state.measurement is not None
    stiffness, frequency = picture.points
    assert np.interp(stiffness[-1], *picture.curve) == pytest.approx(frequency[-1], rel=1e-3)
    assert picture.measured_frf is not None
    wanted = receptance(state.spindle, picture.model_frf.frequency, loss_factor=2 * damping(state.measurement.followed))
    assert np.max(np.abs(picture.model_frf.receptance - wanted)) < 2e-4 * np.max(np.abs(wanted))
    figure = plot_model(picture)
    shaft, curve, shapes, whirl, frf = figure.axes
    assert "shaft" in shaft.get_title()
    assert "whirl" in whirl.get_title()
    assert np.asarray(curve.lines[0].get_ydata()) == pytest.approx(picture.curve[1])
    assert np.max(np.abs(np.asarray(shapes.lines[0].get_ydata()))) == pytest.approx(1)
    assert len(frf.lines) == 2
    figure.savefig(folder.path / "model.png")


def damping(mode: Any) -> float:
    return float(mode.damping_ratio)


def with_program(folder: MachineFolder) -> None:
    """Add a program of the long tool, which is never tapped."""
    program = EXAMPLE_PROGRAM.format(tool=TOOL)
    toml = folder.toml.read_text("utf-8")
    folder.toml.write_text(
        toml.replace("# A tool that is not tapped", program + "# A tool that is not tapped"), "utf-8"
    )


def test_one_tap_predicts_the_lobes_of_every_tool(folder: MachineFolder) -> None:
    with_program(folder)
    folder = MachineFolder(folder.path)
    folder.commit(tapped(folder, 0.6))
    found = said("lobes", folder.path, "--tool", TOOL)
    drawn = folder.machine.model(TOOL)
    worn = replace(drawn, bearings=[replace(b, stiffness=0.6 * b.stiffness) for b in drawn.bearings])
    frequency, stiffness = modes_at(worn, 12)
    modes = [Mode(f, 0.029, k) for f, k in zip(frequency, stiffness, strict=True)]
    cuts, speeds = folder.machine.cuts(TOOL)[REFERENCE_CUT], speed_grid(folder.machine)
    expected = lower_envelope([zero_order_lobes(modes, modes, cut, speeds) for cut in cuts])
    assert found["minimum_depth_mm"] == pytest.approx(expected.minimum.depth * 1e3, rel=0.02)
    assert found["remarks"][0]["code"] == "predicted"
    coupled = said("lobes", folder.path, "--tool", TOOL, "--source", "frf")
    assert coupled["minimum_depth_mm"] == pytest.approx(found["minimum_depth_mm"], rel=0.02)
    measured = said("lobes", folder.path)
    assert measured["minimum_depth_mm"] > 2 * found["minimum_depth_mm"]
    assert "predicted" not in [remark["code"] for remark in measured["remarks"]]


def test_check_predicts_where_a_tool_was_never_tapped(folder: MachineFolder) -> None:
    program = EXAMPLE_PROGRAM.format(tool=TOOL).strip()
    toml = folder.toml.read_text("utf-8")
    old = toml[toml.index("[[program]]") : toml.index("# The spindle of the example")]
    folder.toml.write_text(toml.replace(old, f"{program}\n\n"), "utf-8")
    folder = MachineFolder(folder.path)
    folder.commit(tapped(folder, 1.0))
    (long,) = Logbook(folder).verdicts()
    assert long.assembly is not None
    assert long.assembly.tap_id.startswith("prediction from ")
    assert not long.is_measured
    assert {"predicted", "one-direction"} <= {remark.code for remark in long.remarks}
    assert long.limit == pytest.approx(0.4e-3, rel=0.5)
    assert long.stability is Stability.DOUBTFUL
    shown = invoke(["check", str(folder.path)])
    assert re.search(r"doubtful\s+\(predicted\)", shown.stdout)
    assert shown.exit_code == 1
    folder.commit(tapped(folder, 1.0, direction="y", day=2))
    tame = toml.replace(old, f"{program.replace('depth_mm = 0.3', 'depth_mm = 0.05')}\n\n")
    folder.toml.write_text(tame, "utf-8")
    shown = invoke(["check", str(folder.path)])
    assert re.search(r"stable\s+\(predicted\)", shown.stdout)
    assert (shown.exit_code, "1 program: 1 stable" in shown.stdout) == (0, True)


def test_predictions_need_a_model_and_a_tap(folder: MachineFolder) -> None:
    folder.commit(tapped(folder, 1.0))
    for arguments, message in (
        (("--tool", "drill"), "'drill'"),
        (("--tool", TOOL, "--waterfall", "w.png"), "--waterfall"),
    ):
        with pytest.raises(ValueError, match=message):
            invoke(["lobes", str(folder.path), *arguments])


def test_a_prediction_is_rejected_before_the_first_tap(folder: MachineFolder) -> None:
    with pytest.raises(ValueError, match="long end mill"):
        predict_assembly(folder.machine, [], TOOL)


def test_an_unknown_tool_and_a_machine_without_a_model_are_rejected(folder: MachineFolder, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"'drill'.*'reference', 'long end mill'"):
        build_model_state(folder.machine, None, "drill")
    make_machine_folder(tmp_path / "plain", "new_machine.toml")
    with pytest.raises(ValueError, match=r"\[spindle\]"):
        build_model_state(MachineFolder(tmp_path / "plain").machine, None)
