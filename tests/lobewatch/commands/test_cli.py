"""Commands as a person runs them: results, JSON, exit codes, errors."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import TapsEmulator
from lobes import read_history
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import LOCK_TIMEOUT, FolderLock
from lobewatch.show.report.report import render_report
from lobewatch.tap.emulated_spindle import build_structure
from tests.lobewatch.commands.conftest import Run, refused
from tests.lobewatch.tapped_emulator import make_emulator


@pytest.fixture
def device(trial: MachineFolder) -> Iterator[TapsEmulator]:
    """Start an emulated DAQ on the example spindle."""
    table = trial.machine.spindle
    assert table is not None
    structure = build_structure(table.build(), table.damping_ratio)
    with make_emulator(structure, np.random.default_rng(1), realtime=False) as emulated:
        yield emulated


def test_a_live_tap_finds_the_emulated_spindle(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    said = run("tap", "trial", "--port", device.port, "--operator", "Kim", "--details")
    assert said.code == 0
    assert "10 / 10  ✓ GOOD" in said.err
    assert "1713.0" in said.out
    assert re.search(r" (1280\.\d|1279\.\d)", said.out)
    assert "A: slot at 12 600 rpm" in said.out
    (entry,) = trial.taps()
    assert trial.read(entry).circumstances.operator == "Kim"


def test_json_of_a_live_tap(run: Run, device: TapsEmulator) -> None:
    ended = run("tap", "trial", "--port", device.port, "--json", "--temperature", "24.5", "--accept", "other-band")
    assert ended.err.count("--accept other-band") == 1
    said = ended.json
    assert said["conditions"] == {"temperature_c": 24.5}
    assert said["followed"]["frequency_hz"] == pytest.approx(1713.05, abs=0.5)
    assert 0 < said["followed"]["frequency_hz_std"] < 0.1
    assert said["calibration"]["bearing_stiffness_n_per_m"] == pytest.approx(1.28e9, rel=0.01)
    assert [program["stable"] for program in said["programs"]] == [True, True, True]


def test_an_interrupted_tap_is_resumed_and_new_restarts(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    from datetime import UTC, datetime
    from itertools import islice

    from acquisition import Circumstances, TapsSource, Trigger, capture_hits, check_hit
    from lobewatch.tap.tap_in_progress import begin_tap

    with TapsSource(device.port) as source:
        running = begin_tap(trial, Circumstances("trial", datetime.now(UTC), "reference"))
        source.start()
        for hit in islice(capture_hits(source, Trigger(20.0, 6400, 512)), 4):
            running.add(hit, check_hit(hit), "")
    second = run("tap", "trial", "--port", device.port, "--new")
    assert not re.search(r"[34] of 10", second.err)
    said = run("tap", "trial", "--port", device.port)
    assert re.search(r"[34] of 10", said.err)
    assert said.code == 0
    assert running.id in {entry.id for entry in trial.taps()}


Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
SHORT = """
import time
from filelock import FileLock
while True:
    with FileLock(".lock"):
        time.sleep(0.05)
    time.sleep(0.005)
"""
"""A program that writes for a moment, again and again."""
TAP = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # off where tests run in the background
sys.argv[0] = "lobewatch"
from lobewatch.cli import main
main()
"""


@pytest.mark.parametrize("rounds", [3, pytest.param(8, marks=pytest.mark.long)])
def test_a_tap_waits_for_those_who_write_for_a_moment(
    run: Run, trial: MachineFolder, device: TapsEmulator, rounds: int
) -> None:
    with subprocess.Popen([sys.executable, "-c", SHORT], cwd=trial.path) as writer:
        try:
            taps = [run("tap", "trial", "--port", device.port) for _ in range(rounds)]
        finally:
            writer.kill()
    assert [(said.code, said.err) for said in taps if said.code] == []
    assert len(trial.taps()) == rounds


def test_who_must_wait_for_a_tap_test_too_long_is_told_so(run: Run, trial: MachineFolder) -> None:
    table = trial.machine.spindle
    assert table is not None
    structure = build_structure(table.build(), table.damping_ratio)
    with make_emulator(structure, np.random.default_rng(1), realtime=True) as slow:
        command = [sys.executable, "-c", TAP, "tap", "trial", "--port", slow.port]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            assert process.stderr.readline()
            refused(run("tap", "trial", "--port", "x"), "lobewatch tap", f"process {process.pid}")
            process.send_signal(signal.SIGINT)
            process.communicate()
    assert process.returncode == 130
    assert run("event", "trial", "oiled").code == 0


@pytest.mark.parametrize(
    ("patience", "command"),
    [
        (0.0, ("history",)),
        (0.0, ("status",)),
        (0.0, ("verify",)),
        (LOCK_TIMEOUT, ("event", "oiled")),
        (LOCK_TIMEOUT, ("exclude", "202601", "--reason", "trial")),
        (LOCK_TIMEOUT, ("observe", "--program", "A", "--speed", "9000", "--depth", "1", "--stable")),
        (LOCK_TIMEOUT, ("rebuild",)),
    ],
)
def test_only_who_was_asked_to_write_waits(
    run: Run, shop: Shop, monkeypatch: pytest.MonkeyPatch, patience: float, command: tuple[str, ...]
) -> None:
    shop.tap(0, 1713.0)
    shop.tap_both(30)
    waited, held = [], FolderLock.hold

    def asked(lock: FolderLock, patience: float) -> AbstractContextManager[None]:
        waited.append(patience)
        return held(lock, patience)

    monkeypatch.setattr(FolderLock, "hold", asked)
    name, *options = command
    assert run(name, shop.path, *options).code == 0
    assert waited[0] == patience


def test_a_tap_without_a_device(run: Run, trial: MachineFolder) -> None:
    refused(run("tap", "trial"), "--port", "[daq]")
    refused(run("tap", "trial", "--port", "/dev/ttyNOPE"), "/dev/ttyNOPE", "No such file")
    refused(run("tap", "trial", "--port", "x", "--direction", "z"), "direction", "'z'")


def test_a_taken_port(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    from acquisition import TapsSource

    with TapsSource(device.port):
        refused(run("tap", "trial", "--port", device.port), device.port, "program")


def test_the_real_beam_hit(run: Run, beam: Path) -> None:
    modes = run("modes", beam, "--json").json["modes"]
    known = ((695.8, 0.0047, True), (1898, 0.0031, True), (3671, 0.0019, False), (5975, 0.0044, False))
    for f, zeta, positive in known:
        (mode,) = (mode for mode in modes if abs(mode["frequency_hz"] / f - 1) < 2e-3)
        assert mode["damping_ratio"] == pytest.approx(zeta, rel=0.15)
        assert mode["driving_point"] is positive
    assert "driving point" in run("modes", beam).out


def test_replay_of_the_real_beam_hit_into_a_fresh_machine(run: Run, beam: Path) -> None:
    run("init", "plain")
    (measurement,) = run("replay", "plain", beam, "--json").json["measurements"]
    assert len(measurement["modes"]) >= 4
    assert measurement["lobes"] == []
    codes = {remark["code"]: remark["text"] for remark in measurement["remarks"]}
    assert {"no-bearing-stiffness", "no-lobes-driving-point"} <= set(codes)
    assert measurement["time"].startswith("2018-12-17T10:18:21")
    again = run("replay", "plain", beam)
    assert beam.name in again.err
    assert "0 of 1" in again.out
    assert len(MachineFolder("plain").taps()) == 1
    assert run("report", "plain").code == 0
    refused(run("lobes", "plain"), "driving point")


def test_replay_rejects_what_cannot_be_trusted_and_stores_nothing(
    run: Run, beam: Path, clipped_beam: Path, cnc_csv: Path
) -> None:
    run("init", "plain")
    refused(run("replay", "plain", beam, clipped_beam), "camera.lvm", "overload")
    refused(run("replay", "plain", cnc_csv), cnc_csv.name, "force")
    refused(run("replay", "plain", "nowhere.lvm"), "nowhere.lvm", "No such file")
    assert MachineFolder("plain").taps() == []


def test_replay_of_a_tap_file_with_a_date(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    run("tap", "trial", "--port", device.port)
    (entry,) = trial.taps()
    run("init", "other", "--example")
    said = run(
        "replay", "other", f"trial/taps/{entry.id}.h5", "--date", "2025-03-01", "--direction", "y", "--json"
    ).json
    (measurement,) = said["measurements"]
    assert measurement["time"].startswith("2025-03-01T00:00:00")
    assert measurement["direction"] == "y"
    assert measurement["calibration"]["bearing_stiffness_n_per_m"] == pytest.approx(1.28e9, rel=0.01)


def test_replay_believes_what_a_tap_file_says_of_itself(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    run("tap", "trial", "--port", device.port, "--direction", "y", "--tool", "drill", "--operator", "Ada")
    (entry,) = trial.taps()
    file = f"trial/taps/{entry.id}.h5"
    assert "0 of 1" in run("replay", "trial", file).out
    run("init", "other", "--example")
    (measurement,) = run("replay", "other", file, "--json").json["measurements"]
    assert (measurement["direction"], measurement["tool"]) == ("y", "drill")
    assert measurement["time"] == entry.time
    (copy,) = MachineFolder("other").taps()
    assert MachineFolder("other").read(copy).circumstances.operator == "Ada"
    assert "0 of 1" in run("replay", "other", file).out


def test_lobes_and_report(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    refused(run("lobes", "trial"), "trial", "tap test")
    refused(run("report", "trial"), "trial", "tap test")
    run("tap", "trial", "--port", device.port)
    run("tap", "trial", "--port", device.port)
    said = run("lobes", "trial", "--json", "--figure", "lobes.svg").json
    assert said["minimum_depth_mm"] == pytest.approx(min(said["depth_mm"]))
    assert len(said["speed_rpm"]) == len(said["depth_mm"]) == 1151
    assert Path("lobes.svg").read_text(encoding="utf-8").count("<svg") == 1
    measured = run("lobes", "trial", "--source", "frf", "--json").json
    assert measured["minimum_depth_mm"] == pytest.approx(said["minimum_depth_mm"], rel=0.1)
    assert "A: slot" in run("lobes", "trial", "--cut", "A: slot at 12 600 rpm").out
    refused(run("lobes", "trial", "--cut", "Z"), "'Z'", "'reference'", "B: slot at 6 200 rpm")
    refused(run("lobes", "trial", "--figure", "lobes.xyz"), "lobes.xyz", ".svg", ".png", ".pdf")
    assert run("report", "trial", "--out", "r.html").out.endswith("r.html\n")
    html = Path("r.html").read_text(encoding="utf-8")
    gauge, *pictures = re.findall(r'<svg [^>]*aria-label="(.*?)"', html)
    assert re.fullmatch(r"f1 change [+-]\d\.\d\d %, .* -5 %, .* -10 %", gauge)
    assert pictures == ["Natural frequency", "Stability lobes", "Bearing stiffness", "Frequency response"]
    assert html.count("<figure") == 4
    assert "http" not in html.replace("http://www.w3.org", "").replace("https://matplotlib.org", "").replace(
        "http://purl.org", ""
    ).replace("http://creativecommons.org", "")
    refused(run("report", "trial", "--tool", "T9"), "'T9'")


def test_a_name_with_markup_is_shown_as_it_is(run: Run, trial: MachineFolder, device: TapsEmulator) -> None:
    trial.toml.write_text(trial.toml.read_text().replace('name = "A: slot at 12 600 rpm"', 'name = "<b>[bold]&x"'))
    assert "<b>[bold]&x" in run("tap", "trial", "--port", device.port).out
    run("report", "trial")
    html = Path("trial/report.html").read_text(encoding="utf-8")
    assert "<b>[bold]" not in html
    assert "&lt;b&gt;[bold]&amp;x" in html
    assert callable(render_report)


def test_init(run: Run, trial: MachineFolder) -> None:
    refused(run("init", "trial"), "trial/machine.toml")
    assert run("init", "new", "--json").json["machine_toml"] == str(Path("new/machine.toml"))
    assert MachineFolder("new").machine.machine.name == "new"
    refused(run("tap", "nowhere", "--port", "x"), "machine.toml", "lobewatch init nowhere")


def test_modes_of_bad_files_and_bands(run: Run, beam: Path, tmp_path: Path) -> None:
    refused(run("modes", "nowhere.h5"), "nowhere.h5", "No such file")
    (tmp_path / "empty.csv").touch()
    refused(run("modes", "empty.csv"), "empty.csv")
    refused(run("modes", tmp_path), str(tmp_path), "lobewatch modes MACHINE TAP")
    refused(run("modes", beam, "--band", 30000, 40000), "30000", "40000")
    refused(run("modes", beam, "--band", 2000, 1000), "band")
    assert run("modes", beam, "--band", 600, 800, "--figure", "modes.png").out.count("695.") >= 1
    assert Path("modes.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "name",
    [
        *("demo", "init", "ports", "tap", "replay", "modes", "model", "calibrate", "lobes", "check", "report"),
        *("emulate taps", "emulate dataq"),
    ],
)
def test_every_command_has_help_with_examples_and_json(run: Run, name: str) -> None:
    said = run(*name.split(), "--help")
    assert said.code == 0
    assert "Examples:" in said.out
    assert "a  in" not in said.out  # a key in brackets taken for markup
    assert "--json" in said.out


def test_wrong_use(run: Run) -> None:
    for arguments in (("nonsense",), ("modes",), ("calibrate", "x"), ("demo", "--taps", "1")):
        said = run(*arguments)
        assert said.code == 2
        assert "Traceback" not in said.err
    assert run("--version").out == "lobewatch 1.0.0\n"


@pytest.mark.parametrize("name", [".", "./mill", "/tmp", "_", "", "\u202estatus", "\U0001f642"])
def test_what_is_no_command_is_reported_to_be_none(run: Run, name: str) -> None:
    said = run(name)
    assert said.code == 2
    assert "No such command" in said.err


def test_debug_shows_the_traceback(run: Run) -> None:
    with pytest.raises(FileNotFoundError):
        run("--debug", "modes", "nowhere.h5")


def test_the_demo_finds_the_truth_of_every_tap(run: Run) -> None:
    said = run("demo", "--taps", 12, "--json").json
    assert [tap["direction"] for tap in said["taps"]] == ["x", "y"] * 12
    bounds = {"frequency_hz": 5e-4, "damping_ratio": 0.03, "stiffness_n_per_m": 0.02, "bearing_stiffness_n_per_m": 0.01}
    for tap in said["taps"]:
        for field, bound in bounds.items():
            assert tap["found"][field] == pytest.approx(tap["truth"][field], rel=bound)
    first, last = said["taps"][0], said["taps"][-2]
    assert last["truth"]["frequency_hz"] / first["truth"]["frequency_hz"] == pytest.approx(0.9, abs=0.005)
    fall = {kind: last[kind]["stiffness_n_per_m"] / first[kind]["stiffness_n_per_m"] - 1 for kind in ("truth", "found")}
    assert fall["truth"] == pytest.approx(-0.0142, abs=5e-4)
    assert fall["found"] == pytest.approx(fall["truth"], abs=0.004)
    taps = MachineFolder("lobewatch-demo").taps()
    assert [tap.direction for tap in taps] == ["x", "y"] * 12
    assert [tap.time for tap in taps] == [tap["date"] for tap in said["taps"]]
    run("history", "lobewatch-demo", "--hdf5", "history.h5")
    columns = read_history("history.h5").columns
    for name, field in zip(("frequency", "damping_ratio", "stiffness", "bearing_stiffness"), bounds, strict=True):
        truth = np.array([tap["truth"][field] for tap in said["taps"]])
        score = (np.asarray(columns[name], float) - truth) / np.asarray(columns[f"{name}_std"], float)
        assert 0.5 < np.sqrt(np.mean(score**2)) < 2, f"standard errors of {name} are not of the size of the errors"
    html = Path(said["report"]).read_text(encoding="utf-8")
    last = datetime.fromisoformat(taps[-1].time)
    assert datetime.now(UTC) - timedelta(days=32) < last < datetime.now(UTC)
    assert f" {datetime.now().astimezone():%Y-%m-%d}." in html
    assert f"{last + timedelta(days=30):%Y-%m-%d}</strong>" in html
    fallen = dict(re.findall(r'<th scope="row">reference, ([xy])</th>.*?<td>-(\d+\.\d+)\s±', html))
    for direction, newest in zip("xy", said["taps"][-2:], strict=True):
        truths = np.log([tap["truth"]["frequency_hz"] for tap in said["taps"] if tap["direction"] == direction])
        start = np.exp(np.polyval(np.polyfit(np.arange(12), truths, 1), 0))
        fell = 100 * (1 - newest["truth"]["frequency_hz"] / start)
        assert float(fallen[direction]) == pytest.approx(fell, abs=0.06)
    words = {
        row[1]: re.findall(r"(not stable|stable|doubtful|unknown|not checked)</td>", row[0])
        for row in re.finditer(r'<tr><th scope="row">([ABC]):.*?</tr>', html, re.DOTALL)
    }
    assert {name: len(said) for name, said in words.items()} == {"A": 2, "B": 2, "C": 2}
    shown = run("demo", "--taps", 2, "--seed", 3)
    assert "lobewatch-demo-2" in shown.out
    assert "0.1 %" in shown.out
    table = shown.out.splitlines()[5:10]
    before = last.replace(day=1) - timedelta(days=1)
    assert [line[:9] for line in table[1:]] == [f"{month:%Y-%m} {way}" for month in (before, last) for way in "xy"]
    assert max(map(len, table)) <= 80
    refused(run("demo", "--out", "lobewatch-demo"), "lobewatch-demo/machine.toml")


@pytest.mark.long
def test_the_demo_over_tcp_needs_no_pseudo_terminal_and_finds_the_same(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_pty = run("demo", "--taps", 2, "--json").json["taps"]

    def none_left() -> None:
        raise OSError("out of pty devices")

    monkeypatch.setattr("pty.openpty", none_left)
    assert run("demo", "--taps", 2, "--tcp", "--json").json["taps"] == by_pty
    refused(run("demo", "--taps", 2), "out of pty devices", "--tcp")


@pytest.mark.parametrize("scatter", ["-0.1", "5.1", "nan"])
def test_a_scatter_that_cannot_be_is_rejected_before_anything_is_made(run: Run, scatter: str) -> None:
    refused(run("demo", "--scatter", scatter), f"--scatter {scatter}", "5 %")
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("ended_by", "ctrl_c"),
    [(signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_IGN)],
    ids=["ctrl-c", "terminated under nohup"],
)
def test_the_emulator_command_serves_a_port_and_ends_quietly(
    trial: MachineFolder, run: Run, ended_by: int, ctrl_c: Callable[..., object] | int
) -> None:
    command = [sys.executable, "-m", "lobewatch.cli", "emulate", "taps", "trial", "--fast", "--seed", "4", "--json"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, ctrl_c),
    ) as process:
        assert process.stdout is not None
        served = json.loads(process.stdout.readline())
        assert served["frequency_hz"] == pytest.approx(1713.05, abs=0.01)
        assert run("tap", "trial", "--port", served["port"]).code == 0
        process.send_signal(ended_by)
        _, err = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "Traceback" not in err


def test_a_killed_tap_goes_on_at_the_same_hit(trial: MachineFolder, run: Run) -> None:
    table = trial.machine.spindle
    assert table is not None
    structure = build_structure(table.build(), table.damping_ratio)
    with make_emulator(structure, np.random.default_rng(1), realtime=True) as slow:
        command = [sys.executable, "-m", "lobewatch.cli", "tap", "trial", "--port", slow.port]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            announced = [next(line for line in process.stderr if "/ 10" in line) for _ in range(3)]
            os.kill(process.pid, signal.SIGKILL)
        good = sum("GOOD" in line for line in announced)
        said = run("tap", "trial", "--port", slow.port)
    there = int(re.search(r"(\d+) of 10", said.err)[1])  # type: ignore[index]
    assert there >= good > 0
    assert said.code == 0
