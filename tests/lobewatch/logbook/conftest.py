"""Live tap tests and mass checks with known sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from acquisition import Channel, Circumstances, Hit, HitFlags, MassCalibration, Structure, TapDirection, new_tap_id
from acquisition.source import DeviceIdentity
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.hit_check import average_hits
from lobewatch.tap.mass_check import store_mass_result
from lobewatch.verdicts import Stability, Verdict

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
RATE, SAMPLES, PRE_TRIGGER, WIDTH = 10240.0, 2048, 100, 6e-4
FORCE, ACCELERATION = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
SENSORS = FORCE, ACCELERATION
DAQ = "board, serial number 1234, firmware 1.0"
DAY = datetime(2026, 3, 2, 9, tzinfo=UTC)
STIFFNESS = 3.5e7


def entered(factor: float) -> tuple[Channel, Channel]:
    """Return the sensors as entered, with the sensitivity of the accelerometer wrong by a factor."""
    return FORCE, replace(ACCELERATION, sensitivity=factor * ACCELERATION.sensitivity)


def strike(structure: Structure, peak: float, sensors: Sequence[Channel]) -> Hit:
    """Return a hit as the true sensors give its codes, and as the entered sensors read them."""
    time = (np.arange(SAMPLES) - PRE_TRIGGER) / RATE
    force = peak * np.where((time >= 0) & (time <= WIDTH), np.sin(np.pi * time / WIDTH) ** 4, 0.0)
    signals = force, peak * structure.response(time, WIDTH)
    noise = np.random.default_rng(round(peak)).normal(scale=(0.05, 0.2), size=(SAMPLES, 2)).T
    codes = [true.encode(signal + part) for true, signal, part in zip(SENSORS, signals, noise, strict=True)]
    return Hit.from_codes(codes, tuple(sensors), RATE, PRE_TRIGGER)


def tap(
    shop: Shop,
    direction: TapDirection,
    days: float = 0.0,
    sensors: Sequence[Channel] = SENSORS,
    *,
    device: str = DAQ,
    tool: str = "plain",
    frequency: float = 1713.0,
) -> str:
    """Store a live tap test so many days after the first, and return its id."""
    about = Circumstances("m", DAY + timedelta(days=days), tool, direction, device=device)
    structure = Structure(np.array([frequency]), np.array([0.03]), np.array([STIFFNESS]))
    hits = [strike(structure, peak, sensors) for peak in (150.0, 200.0, 250.0)]
    test = average_hits(new_tap_id(about), about, hits, [HitFlags.OK] * 3)
    MachineFolder(shop.path).commit(test)
    return test.id


def tap_both(shop: Shop, days: float = 0.0, sensors: Sequence[Channel] = SENSORS, **options: Any) -> None:
    tap(shop, "x", days, sensors, **options)
    tap(shop, "y", days + 0.01, sensors, frequency=1690.0, **options)


def hit_mass(shop: Shop, days: float, sensors: Sequence[Channel] = SENSORS, *, ratio: float = 1.0, **of: str) -> Any:
    """Store the result of a mass check with a ratio F/(m a)."""
    result = MassCalibration(ratio, 0.001, 0.1, False, 0.001, (50.0, 3000.0), 1.2, 10, tuple(sensors))
    identity = DeviceIdentity(of.get("model", "board"), of.get("serial", "1234"))

    class Connected:
        channels = tuple(sensors)

    device: Any = Connected()
    device.identity = identity
    return store_mass_result(shop.folder, device, result, "Kim", DAY + timedelta(days=days))


def verdict(shop: Shop) -> Verdict:
    (found,) = Logbook.open(shop.path).verdicts(names=["A"])
    return found


def evidence(shop: Shop) -> list[str | None]:
    """Return the evidence of the tap tests behind the verdict, which is stable only with evidence for all."""
    found = verdict(shop)
    checks = found.assembly.chain_checks if found.assembly else ()
    is_checked = all(check.evidence for check in checks)
    assert found.stability is (Stability.STABLE if is_checked else Stability.DOUBTFUL)
    assert (found.decisive_cause == "unchecked") is not is_checked
    assert ("chain-not-checked" in [remark.code for remark in found.remarks]) is not is_checked
    return [check.evidence for check in checks]


@pytest.fixture
def plain(shop: Shop) -> Shop:
    """Return a machine with a program for a tool that has no drawing."""
    shop.run(("A", 12900, 0.05), tool="plain")
    return shop
