"""Checks of the sensors behind tap tests: known mass, spindle model, another tool, printed sensitivities."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

import msgspec
import pytest

from acquisition import Channel, Circumstances, MassCalibration
from acquisition.source import DeviceIdentity
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import exclude_entry
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, find_deciding_check
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.tap.device_connection import describe_device
from lobewatch.tap.mass_check import store_mass_result
from lobewatch.verdicts import Stability
from tests.lobewatch.logbook.conftest import (
    ACCELERATION,
    DAQ,
    DAY,
    FORCE,
    SENSORS,
    STIFFNESS,
    Shop,
    entered,
    evidence,
    hit_mass,
    tap,
    tap_both,
    verdict,
)


def test_a_mass_check_makes_stable_what_is_doubtful_without(plain: Shop) -> None:
    tap_both(plain)
    assert evidence(plain) == [None, None]
    status = Logbook.open(plain.path).status(DAY)
    assert ("chain-not-checked", "plain, x") in [(reason.code, reason.about) for reason in status.reasons]
    assert status.status == "warn"
    assert hit_mass(plain, 1.0).passed
    assert evidence(plain) == ["mass-check"] * 2
    found = verdict(plain).assembly
    assert found is not None
    assert [check.date for check in found.chain_checks] == [DAY + timedelta(days=1)] * 2
    assert Logbook.open(plain.path).status(DAY).status == "good"


@pytest.mark.parametrize("factor", [3.0, 1 / 3])
def test_a_sensitivity_that_is_wrong_from_the_first_test_on_is_never_stable(plain: Shop, factor: float) -> None:
    wrong = entered(factor)
    tap_both(plain, sensors=wrong)
    found = verdict(plain).assembly
    assert found is not None
    assert found.x is not None
    assert found.x[0].stiffness == pytest.approx(factor * STIFFNESS, rel=0.02)
    assert evidence(plain) == [None, None]
    hit_mass(plain, -1.0)
    assert evidence(plain) == [None, None]
    assert not hit_mass(plain, 1.0, wrong, ratio=factor).passed
    assert evidence(plain) == [None, None]


@pytest.mark.parametrize(
    ("sensors", "device"),
    [
        ((replace(FORCE, sensitivity=2.3e-3), replace(ACCELERATION, full_scale=5.4)), DAQ),
        (SENSORS, "board, serial number 1235, firmware 1.0"),
    ],
)
def test_a_change_of_the_chain_ends_the_check(plain: Shop, sensors: Sequence[Channel], device: str) -> None:
    hit_mass(plain, -1.0)
    tap_both(plain)
    assert evidence(plain) == ["mass-check"] * 2
    tap(plain, "x", 1.0, sensors, device=device)
    assert sorted(map(str, evidence(plain))) == ["None", "mass-check"]
    (remark,) = verdict(plain).assembly.unchecked  # type: ignore[union-attr]
    assert remark.about == "direction x"


@pytest.mark.parametrize("name", SensorChain.__struct_fields__)
def test_a_check_counts_for_its_own_chain_only(name: str) -> None:
    chain = SensorChain("1234", 2.25e-3, 1.02e-3, 5.0, 5.0)
    other = msgspec.structs.replace(chain, **{name: "1235" if name == "daq" else 1.001 * getattr(chain, name)})
    check = MassCheckEntry("m1", DAY, 1.2, 1.0, 0.001, True, chain)
    assert find_deciding_check(chain, DAY, [check]) is check
    assert find_deciding_check(other, DAY, [check]) is None


def test_a_check_that_fails_marks_the_tests_since_the_last_good_one(plain: Shop) -> None:
    tap_both(plain)
    hit_mass(plain, 1.0)
    tap_both(plain, 2.0)
    assert evidence(plain) == ["mass-check"] * 2
    failed = hit_mass(plain, 3.0, ratio=1.49)
    assert evidence(plain) == [None, None]
    hit_mass(plain, 4.0)
    assert evidence(plain) == [None, None]
    logbook = Logbook.open(plain.path)
    checks = [logbook.chain_check(entry.id).evidence for entry in logbook.taps]
    assert checks == ["mass-check", "mass-check", None, None]
    exclude_entry(plain.folder, failed.id, "the mass was wrong")
    assert evidence(plain) == ["mass-check"] * 2
    tap_both(plain, 5.0)
    assert evidence(plain) == ["mass-check"] * 2


def test_a_result_that_is_no_measure_of_the_sensitivities_is_not_stored(plain: Shop) -> None:
    result = MassCalibration(1.0, 0.2, 0.1, False, 0.001, (50.0, 3000.0), 1.2, 10, SENSORS)
    device: Any = type("Connected", (), {"channels": SENSORS, "identity": DeviceIdentity("board", "1234")})()
    assert store_mass_result(plain.folder, device, result) is None
    assert store_mass_result(plain.folder, device, replace(result, ratio_std=0.01, phase=20.0)) is None
    assert plain.folder.contents().mass_checks == ()


def test_the_newest_of_the_checks_of_a_day_decides(plain: Shop) -> None:
    tap_both(plain)
    hit_mass(plain, 1.0, ratio=3.0)
    assert evidence(plain) == [None, None]
    hit_mass(plain, 1.01)
    assert evidence(plain) == ["mass-check"] * 2
    hit_mass(plain, 1.02, ratio=1.2)
    assert evidence(plain) == [None, None]


def test_nan_is_not_stored(plain: Shop) -> None:
    result = MassCalibration(1.0, 0.001, 0.1, False, 0.001, (50.0, 3000.0), 1.2, 10, SENSORS)
    device: Any = type("Connected", (), {"channels": SENSORS, "identity": DeviceIdentity("board", "1234")})()
    for name in ("ratio", "ratio_std", "phase"):
        assert store_mass_result(plain.folder, device, replace(result, **{name: float("nan")})) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("model", "serial"),
    [
        ("Line (Focusrite, Inc.)", ""),
        ("USB Audio, rev 2", "A, 7"),
        ("Line In, serial number 5", ""),
        ("", ""),
        ("", "7"),
    ],
)
def test_a_tap_test_has_the_chain_of_its_device(model: str, serial: str) -> None:
    identity = DeviceIdentity(model, serial, "1.0, b")
    device: Any = type("Connected", (), {"identity": identity, "loss_detection": "none"})()
    about = Circumstances("m", DAY, "t", "x", device=describe_device(device))
    assert SensorChain.of(identity, SENSORS) == SensorChain.of(about, SENSORS) is not None


def test_a_live_device_without_a_name_is_checked_like_any_other(plain: Shop) -> None:
    tap_both(plain, device="")
    assert evidence(plain) == [None, None]
    hit_mass(plain, 1.0, model="", serial="")
    assert evidence(plain) == ["mass-check"] * 2


def test_a_tap_test_that_is_entered_again_keeps_its_chain(plain: Shop) -> None:
    tap_both(plain)
    hit_mass(plain, 1.0, ratio=3.0)
    chains = [entry.chain for entry in plain.folder.contents().taps]
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        plain.path.joinpath(name).unlink(missing_ok=True)
    rebuild_files(plain.path)
    assert [entry.chain for entry in plain.folder.contents().taps] == chains != [None, None]
    assert evidence(plain) == [None, None]


def test_older_and_replayed_tests_keep_their_verdict_with_a_remark(plain: Shop) -> None:
    tap_both(plain, device="replay of hits.h5")
    found = verdict(plain)
    assert found.stability is Stability.STABLE
    assert [remark.code for remark in found.remarks].count("chain-not-checked") == 1
    assert "chain" not in plain.path.joinpath("journal.jsonl").read_text("utf-8")


def test_the_journal_keeps_check_and_chain(plain: Shop) -> None:
    stored, tap_id = hit_mass(plain, -1.0, ratio=1.02), tap(plain, "x")
    lines = [json.loads(line) for line in plain.path.joinpath("journal.jsonl").read_bytes().splitlines()]
    chain = {"daq": "1234", "force_v_per_n": 2.25e-3, "acceleration_v_per_m_s2": 1.02e-3}
    assert [line["kind"] for line in lines] == ["mass-check", "tap"]
    assert all(line["chain"].items() >= chain.items() for line in lines)
    assert {name: lines[0][name] for name in ("id", "mass_kg", "ratio", "passed", "operator")} == {
        "id": "m1",
        "mass_kg": 1.2,
        "ratio": 1.02,
        "passed": True,
        "operator": "Kim",
    }
    contents = plain.folder.contents()
    assert contents.mass_checks == (stored,)
    assert [(entry.id, entry.chain) for entry in contents.taps] == [(tap_id, stored.chain)]
