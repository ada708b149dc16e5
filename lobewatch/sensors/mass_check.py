"""Hammer and accelerometer on a hung mass: F = m a."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from acquisition import Device, Hit, MassCalibration, SensorPlace, calibrate_by_mass, capture_hits, judge_hit
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import checked_rate
from lobewatch.tap.live_signal import LiveSignal
from lobewatch.tap.plug import sensor_place
from lobewatch.tap.self_check import quiet_stretch
from lobewatch.tap.trial import Trial

BASELINE_SECONDS = 0.5
"""Time that is listened before the first hit (s)."""


@dataclass(frozen=True)
class MassCheck:
    """What a hung mass says, and where to change what is wrong."""

    calibration: MassCalibration
    """Force over mass times acceleration, and what follows from it."""
    place: SensorPlace | None
    """Place where the device keeps its sensitivities; None where machine.toml does."""


def check_mass(folder: MachineFolder, port: str, device: Device, mass: float, tell: Callable[[str], None]) -> MassCheck:
    """Take good hits on a freely hung mass (kg) and compare; tell: what to do, and the verdict on each hit."""
    hits = _good_hits(folder, device, tell)
    return MassCheck(calibrate_by_mass(hits, mass), sensor_place(folder.machine.daq, port))


def _good_hits(folder: MachineFolder, device: Device, tell: Callable[[str], None]) -> list[Hit]:
    """As many hits without a fault as a tap test takes."""
    wanted = folder.machine.tap.hits
    checked_rate(folder, device)
    tell(f"HIT the hung mass opposite the accelerometer, {wanted} times; wait until it is still")
    good: list[Hit] = []
    device.start()
    baseline = quiet_stretch(LiveSignal(device).record(device.blocks(), BASELINE_SECONDS))
    for hit in capture_hits(device, Trial(folder.machine.tap, baseline).trigger):
        verdict = judge_hit(hit)
        if not verdict.flags:
            good.append(hit)
        text = f"✗ {verdict.flags.words.upper()}  {verdict.text}" if verdict.flags else "✓ GOOD"
        tell(f"{len(good):3d} / {wanted}  {text}")
        if len(good) >= wanted:
            break
    device.stop()
    return good
