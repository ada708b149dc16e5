"""Tap test through a real sound server: PortAudio, ALSA and PulseAudio, with a null sink as cable."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
import wave
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from acquisition import Device, DeviceIdentity, HammeredStructure, Hammering, MeasuredRate, Structure
from lobewatch.machine.daq_rates import apply_measured_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.kept_rate import RATE_FILE_NAME

RATE = 48000
FULL_SCALE = 5.0
SENSITIVITIES = np.array([[2.25e-3], [10e-3 / 9.80665]])
NEEDED = find_spec("sounddevice") and shutil.which("pulseaudio") and shutil.which("paplay")

pytestmark = pytest.mark.skipif(
    not NEEDED and "CI" not in os.environ, reason="needs sounddevice, PortAudio and PulseAudio"
)


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Return an environment with one sound device, "wire", that records its own output."""
    (tmp_path / ".asoundrc").write_text('pcm.wire { type pulse device "wire.monitor" }\n', "utf-8")
    (tmp_path / "run").mkdir()
    environment = os.environ | {"HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(tmp_path / "run")}
    sink = f"module-null-sink sink_name=wire rate={RATE} format=s32le channels=2"
    command = ["pulseaudio", "-n", "--daemonize=no", "--exit-idle-time=-1", "--load=module-native-protocol-unix"]
    with subprocess.Popen([*command, f"--load={sink}"], env=environment, stderr=subprocess.DEVNULL) as server:
        try:
            for _ in range(600):
                if subprocess.run(["pactl", "info"], env=environment, capture_output=True, check=False).returncode == 0:
                    break
                time.sleep(0.1)
            yield environment
        finally:
            server.terminate()


def record_hits(path: Path, structure: Structure, seconds: float) -> None:
    """Write a 32-bit sound file of impacts."""
    signal = HammeredStructure(structure, RATE, np.random.default_rng(1), Hammering())
    volts = signal(0, round(seconds * RATE)) * SENSITIVITIES
    codes = np.clip(np.rint(volts / FULL_SCALE * 2**31), -(2**31), 2**31 - 1).astype("<i4")
    with wave.open(str(path), "wb") as file:
        file.setparams((2, 4, RATE, 0, "NONE", ""))
        file.writeframes(codes.T.tobytes())


def play_and_run(command: list[str], environment: dict[str, str], file: Path) -> subprocess.CompletedProcess[str]:
    """Run a command while the cable carries a sound file."""
    with subprocess.Popen(["paplay", "--device=wire", str(file)], env=environment) as player:
        try:
            return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=90)
        finally:
            player.terminate()


def test_a_whole_tap_test_through_a_sound_server(cable: dict[str, str], structure: Structure, tmp_path: Path) -> None:
    record_hits(tmp_path / "hits.wav", structure, 60.0)
    make_machine_folder(tmp_path / "trial", "new_machine.toml")
    toml = tmp_path / "trial" / "machine.toml"
    channel = '[[daq.channel]]\ninput = {}\nquantity = "{}"\n{}\nrange_v = 5\n'
    force = channel.format(0, "force", "sensitivity_mv_per_n = 2.25")
    acceleration = channel.format(1, "acceleration", "sensitivity_mv_per_g = 10")
    daq = f'[daq]\ndriver = "audio"\nport = "audio:wire"\naccept_measured_rate = true\n{force}{acceleration}\n'
    toml.write_text(toml.read_text("utf-8").replace("[daq]\n", daq, 1), "utf-8")
    known = SimpleNamespace(identity=DeviceIdentity("wire", "wire"), sample_rate=float(RATE), follows_clock=True)
    folder, nominal = MachineFolder(toml.parent), MeasuredRate(float(RATE), 1.0, 5 * RATE, 5.0)
    apply_measured_rate(folder, cast("Device", known), nominal)
    lobewatch = [sys.executable, "-m", "lobewatch.cli"]
    listed = subprocess.run([*lobewatch, "ports", "--json"], env=cable, capture_output=True, text=True, check=True)
    assert "audio:wire" in [port["device"] for port in json.loads(listed.stdout)["ports"]]
    tap = [*lobewatch, "tap", str(toml.parent), "--direction", "x", "--json"]
    tapped = play_and_run(tap, cable, tmp_path / "hits.wav")
    if tapped.returncode == 2 and list(folder.spool.glob(f"*/{RATE_FILE_NAME}")):  # refused: the null sink is slow
        tapped = play_and_run(tap, cable, tmp_path / "hits.wav")
    assert tapped.returncode == 0, tapped.stderr
    (rate,) = {hit.sample_rate for entry in folder.taps() for hit in folder.read(entry).hits}
    assert rate == pytest.approx(RATE, rel=0.01)
    followed, ratio = json.loads(tapped.stdout)["followed"], rate / RATE
    assert followed["frequency_hz"] == pytest.approx(ratio * 1722.0, abs=max(0.3, 4 * followed["frequency_hz_std"]))
    assert followed["stiffness_n_per_m"] == pytest.approx(ratio**2 * 3.2289e7, rel=0.01)
