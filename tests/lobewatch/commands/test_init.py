"""lobewatch init: a conversation at a terminal, its answers as options, one question asked again."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from acquisition import find_driver
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.setup_questions.questions import SETUP_QUESTIONS
from lobewatch.tap.emulated_spindle import emulate_machine
from tests.lobewatch.commands.conftest import Run, refused
from tests.lobewatch.commands.pty_talk import Terminal

ANSWERS = {
    "name": "Mill 3",
    "speeds": "1000 18000",
    "drive": "15 40",
    "daq": "/dev/ttyNOPE dataq",
    "hammer": "0 2.25 5",
    "accelerometer": "1 10.2 5",
    "fixing": "4,5 g wax",
    "tool": "4 teeth 16 mm 30 deg 80 mm coated carbide",
    "material": "1.7225",
    "program": "slot: 8000 2 16 0,1",
}


def tables(path: str = "mill-3") -> dict[str, Any]:
    return tomllib.loads(Path(path, "machine.toml").read_text("utf-8"))


def options(answers: dict[str, str]) -> list[str]:
    return [word for name, answer in answers.items() for word in (f"--{name}", answer)]


def test_every_answer_is_an_option_and_is_in_the_file(run: Run) -> None:
    said = run("init", "mill-3", "--yes", *options(ANSWERS))
    assert said.code == 0, said.err
    assert said.out.endswith("lobewatch tap mill-3\n")
    assert "/dev/ttyNOPE" in said.err
    known = tables()
    assert known["machine"] == {"name": "Mill 3"}
    assert known["speed"] == {"low_rpm": 1000, "high_rpm": 18000}
    assert known["drive"] == {"power_kw": 15, "torque_nm": 40}
    hammer, accelerometer = known["daq"].pop("channel")
    assert known["daq"] == {"port": "/dev/ttyNOPE", "driver": "dataq"}
    assert hammer == {"input": 0, "quantity": "force", "sensitivity_mv_per_n": 2.25, "range_v": 5}
    assert accelerometer == {"input": 1, "quantity": "acceleration", "sensitivity_mv_per_g": 10.2, "range_v": 5}
    assert [known["tap"][key] for key in ("sensor_mass_g", "mounting", "stick_out_mm")] == [4.5, "wax", 80]
    tool = {"teeth": 4, "tool_diameter_mm": 16, "helix_deg": 30, "direction": "down", "material": "1.7225"}
    assert known["reference_cut"] == tool | {"radial_depth_mm": 16}
    assert known["tool"] == [{"name": "reference", "tool_material": "coated carbide"}]
    program = {"name": "slot", "tool": "reference", "speed_rpm": 8000, "depth_mm": 2, "feed_per_tooth_mm": 0.1}
    assert known["program"] == [tool | program | {"radial_depth_mm": 16}]


def test_the_options_are_the_questions(run: Run) -> None:
    assert [question.name for question in SETUP_QUESTIONS] == list(ANSWERS)
    assert all(f"--{question.name}" in run("init", "--help").out for question in SETUP_QUESTIONS)


def test_where_nobody_sits_nothing_is_asked_and_the_template_is_as_it_was(run: Run) -> None:
    made, next_step = run("init", "plain").out.splitlines()
    assert "plain/machine.toml" in made
    assert next_step.endswith("lobewatch tap plain --port PORT")
    assert run("init", "mill-3", "--yes").code == 0
    plain = Path("plain/machine.toml").read_text("utf-8")
    assert plain.replace('name = "plain"', 'name = "mill-3"') == Path("mill-3/machine.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("name", "answer", "words"),
    [
        ("speeds", "18000 1000", ("low_rpm=18000", "high_rpm=1000")),
        ("speeds", "1000,18000", ("1 number", "rpm")),
        ("drive", "15 lb 40 Nm", ("'lb'",)),
        ("daq", "/dev/ttyNOPE acme", ("'acme'", "taps, dataq")),
        ("daq", "7", ("7",)),
        ("hammer", "0 2.25", ("2 numbers", "mV/N")),
        ("hammer", "0.5 2.25 5", ("0.5",)),
        ("fixing", "4 tape", ("'tape'",)),
        ("tool", "4.5 20 30", ("4.5",)),
        ("tool", "4 20 30 80 wood", ("'wood'",)),
        ("tool", "4 20 95", ("helix_deg",)),
        ("material", "42CrMo5", ("42CrMo5", "'42CrMo4'")),
        ("program", "slot: 8000 2", ("2 numbers",)),
        ("program", "slot: 8000 2 25", ("radial_depth_mm=25", "tool_diameter_mm=16")),
        ("program", "slot: 20000 2 16", ("20000", "1000..18000 rpm")),
    ],
)
def test_an_answer_that_is_none_names_its_option_and_makes_nothing(
    run: Run, name: str, answer: str, words: tuple[str, ...]
) -> None:
    given = {key: text for key, text in (ANSWERS | {name: answer}).items() if key != "daq" or name == "daq"}
    said = run("init", "mill-3", "--yes", *options({"daq": "socket://127.0.0.1:9 dataq"} | given))
    refused(said._replace(err=said.err[said.err.index("error") :]), f"--{name} ", *words)
    assert not Path("mill-3").exists()


def test_a_daq_that_does_not_know_its_sensors_has_them_asked_for(run: Run) -> None:
    said = run("init", "mill-3", "--daq", "/dev/ttyNOPE dataq", "--hammer", "0 2.25 5")
    refused(said._replace(err=said.err[said.err.index("error") :]), "--accelerometer", "range")
    refused(run("init", "mill-3", "--hammer", "0 2.25 5"), "--hammer", "machine.toml: daq")


def test_one_question_is_asked_again_and_comments_and_order_stay(run: Run, tmp_path: Path) -> None:
    run("init", "mill-3", "--yes", *options(ANSWERS))
    toml = Path("mill-3/machine.toml")
    toml.write_text(toml.read_text("utf-8") + "\n# ours: spindle rebuilt in May\n", "utf-8")
    before = toml.read_text("utf-8").splitlines()
    refused(run("init", "mill-3", "--edit", "drive"), "--edit drive", "with --drive")
    refused(run("init", "mill-3", "--edit", "drives"), "drives", "name, speeds, drive")
    refused(run("init", "none", "--edit", "drive"), "none", "machine.toml")
    with Terminal(tmp_path, "init", "mill-3", "--edit", "drive") as person:
        assert "kW" in person.answer("22 60")
        assert person.end() == 0
        assert "mill-3/machine.toml" in person.text
    changed = [pair for pair in zip(before, toml.read_text("utf-8").splitlines(), strict=True) if len(set(pair)) > 1]
    assert changed == [("power_kw = 15", "power_kw = 22"), ("torque_nm = 40", "torque_nm = 60")]
    assert run("init", "mill-3", "--edit", "drive", "--drive", "-").code == 0
    assert tables()["drive"] == {}
    assert run("init", "mill-3", "--edit", "tool", "--tool", "4 16 30 hss").code == 0
    assert tables()["tool"] == [{"name": "reference", "tool_material": "HSS"}]


def test_a_conversation_knows_the_daq_and_takes_enter(run: Run, trial: MachineFolder, tmp_path: Path) -> None:
    device = emulate_machine(trial, find_driver("taps"), realtime=False).device
    with device, Terminal(tmp_path, "init", "mill-3") as person:
        person.answer("")
        person.answer("12000 1000")
        assert "low_rpm=12000" in person.answer("")
        assert "[-]" in person.answer("")
        person.answer(device.port)
        asked = person.answer("0")
        assert "2.25 mV/N" in asked
        assert "10 mV/g" in asked
        person.answer("4 20 30 80")
        person.answer("42CrMo4")
        person.answer("slot: 12600 1.5 20")
        assert person.end() == 0
        assert "lobewatch tap mill-3" in person.text
    assert tables()["daq"] == {"port": device.port}
    assert tables()["program"][0]["material"] == "42CrMo4"


def test_a_conversation_that_is_broken_off_writes_nothing(run: Run, tmp_path: Path) -> None:
    with Terminal(tmp_path, "init", "mill-3") as person:
        person.answer("")
        person.wait_for("> ")
        person.type("\x04")
        assert person.end() == 130
    assert not Path("mill-3").exists()


def test_from_an_empty_folder_to_a_verdict_on_a_tapped_tool_in_three_commands(
    run: Run, trial: MachineFolder, tmp_path: Path
) -> None:
    """init, tap and check at a terminal, with an emulated DAQ and no editor."""
    with emulate_machine(trial, find_driver("taps"), realtime=False).device as device:
        with Terminal(tmp_path, "init", "mill-3") as person:
            for answer in ("", "3000 24000", "-", device.port, "0 glue", "4 20 0", "1400 500", "slot: 16000 0.2 20"):
                person.answer(answer)
            assert person.end() == 0
        with Terminal(tmp_path, "tap", "mill-3", "--accept", "same-direction") as person:
            person.wait_for("MOVE SENSOR")
            person.wait_for("y tap y")
            person.type("\n")
            person.wait_for("direction y")
            person.wait_for("n next tool   q done")
            person.type("n")
            person.wait_for("machine.toml")
            person.type("\n")  # not now
            person.wait_for("n next tool   q done")
            person.type("q")
            assert person.end() == 0
            last = person.text.rstrip().splitlines()[-1]
            assert last.startswith("✓ GOOD  Next: ")
    said = run("check", "mill-3")
    assert (said.code, said.out.splitlines()[-1]) == (0, "1 program: 1 stable")
    assert [tap.direction for tap in MachineFolder("mill-3").taps()] == ["x", "y"]


def test_without_a_force_sensor_the_accelerometer_is_the_only_channel(run: Run) -> None:
    run("init", "mill-3", "--yes", *options(ANSWERS | {"hammer": "none", "accelerometer": "1 10.2 5"}))
    made = tables()
    assert made["tap"]["hammer"] == "none"
    assert [channel["quantity"] for channel in made["daq"]["channel"]] == ["acceleration"]
    assert MachineFolder(Path("mill-3")).machine.tap.hammer == "none"


def test_a_hammer_that_is_chosen_again_takes_none_back(run: Run) -> None:
    run("init", "mill-3", "--yes", *options(ANSWERS | {"hammer": "none"}))
    assert run("init", "mill-3", "--edit", "hammer", "--hammer", "0 2.25 5").code == 0
    made = tables()
    assert "hammer" not in made["tap"]
    assert [channel["quantity"] for channel in made["daq"]["channel"]] == ["acceleration", "force"]


def test_an_accelerometer_is_chosen_again_next_to_a_hammer_that_is_not_used_any_more(run: Run) -> None:
    run("init", "mill-3", "--yes", *options(ANSWERS))
    assert run("init", "mill-3", "--edit", "hammer", "--hammer", "none").code == 0
    assert run("init", "mill-3", "--edit", "accelerometer", "--accelerometer", "1 100 5").code == 0
    made = tables()
    assert made["tap"]["hammer"] == "none"
    assert [channel.get("sensitivity_mv_per_g") for channel in made["daq"]["channel"]] == [None, 100]


def test_a_board_that_prints_lines_is_reported_with_its_rate(run: Run) -> None:
    board = ANSWERS | {"daq": "/dev/ttyNOPE lines 3200", "hammer": "none", "accelerometer": "0 100 1.6"}
    assert run("init", "mill-3", "--yes", *options(board)).code == 0
    assert MachineFolder(Path("mill-3")).machine.daq.sample_rate_hz == 3200
    assert run("init", "mill-3", "--edit", "daq", "--daq", "/dev/ttyNO lines").code == 0
    assert tables()["daq"]["sample_rate_hz"] == 3200
    said = run("init", "mill-4", "--yes", "--daq", "/dev/ttyNOPE lines")
    refused(said, "--daq", "sample_rate_hz")


def test_at_a_terminal_an_option_counts_where_the_daq_names_its_sensors(run: Run, tmp_path: Path) -> None:
    run("init", "mill-3", "--yes", "--name", "Mill 3")
    with Terminal(tmp_path, "init", "mill-3", "--edit", "hammer", "--hammer", "none") as person:
        assert person.end() == 0
    assert tables()["tap"]["hammer"] == "none"


def test_of_a_daq_without_a_force_sensor_the_hammer_is_asked_about(trial: MachineFolder, tmp_path: Path) -> None:
    edited = trial.toml.read_text("utf-8").replace("[tap]\n", '[tap]\nhammer = "none"\n').replace("trigger_n", "# ")
    trial.toml.write_text(edited, "utf-8")
    device = emulate_machine(MachineFolder(trial.path), find_driver("taps"), realtime=False).device
    with device, Terminal(tmp_path, "init", "mill-3") as person:
        for answer in ("", "1000 18000", "-", device.port):
            person.answer(answer)
        assert "none" in person.answer("0 2.25 5")
        person.answer("")
        assert "10 mV/g" in person.answer("-")
