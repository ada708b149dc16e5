"""Checks of the sensors behind tap tests: known mass, spindle model, another tool, printed sensitivities."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Channel, Circumstances, Hit, HitFlags, MassCalibration, Structure, TapDirection, new_tap_id
from acquisition.source import DeviceIdentity
from lobewatch.fleet.summarize import summarize_machine
from lobewatch.history.chain_checks import ChainChecks
from lobewatch.history.history import HistoryRow
from lobewatch.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import exclude_entry, store_mass_check
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, find_deciding_check
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.settings.setup_tables import ChannelTable, DaqTable
from lobewatch.machine.settings.spindle_tables import ToolTable
from lobewatch.measurement.estimate import Estimate
from lobewatch.measurement.sensor_models import fits_sensor_models
from lobewatch.measurement.tool_compliance import SUPPORT_COMPLIANCE, ToolBeam, find_tool_beam, has_plausible_size
from lobewatch.tap.device_connection import describe_device
from lobewatch.tap.hit_check import average_hits
from lobewatch.tap.mass_check import store_emulator_check, store_mass_result
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


def fit_model(shop: Shop, share: float) -> None:
    """Give the program to the drawn tool, whose model has the stiffness of the tap tests times a share."""
    shop.run(("A", 12900, 0.05))
    tap_both(shop, sensors=entered(share), tool="reference")


@pytest.mark.parametrize(("share", "found"), [(1.0, "model"), (1.3, None), (3.0, None), (1 / 3, None)])
def test_a_stiffness_that_agrees_with_the_model_serves_instead_of_a_mass(
    shop: Shop, share: float, found: str | None
) -> None:
    fit_model(shop, share)
    assert evidence(shop) == [found, found]


@pytest.mark.parametrize(("share", "found"), [(1.0, "other-tool"), (3.0, None)])
def test_another_tool_that_agrees_with_its_drawing_on_the_same_day_serves_instead(
    plain: Shop, share: float, found: str | None
) -> None:
    sensors = entered(share)
    tap_both(plain, sensors=sensors)
    tap(plain, "x", 3.0, sensors, tool="reference")
    assert evidence(plain) == [None, None]
    tap(plain, "x", 0.3, sensors, tool="reference")
    assert evidence(plain) == [found, found]


@given(share=st.floats(0.8, 1.0), length=st.floats(0.04, 0.15), is_soft=st.booleans())
def test_the_geometry_of_a_tool_excludes_a_factor_of_3_in_every_plausible_spindle(
    share: float, length: float, is_soft: bool
) -> None:
    tool = ToolBeam(0.016, length, length, "carbide")
    true = tool.compliance * share + (SUPPORT_COMPLIANCE if is_soft else 0.0)

    def is_plausible(compliance: float, highest: float = 2e4) -> bool:
        return has_plausible_size(compliance, tool, highest)

    assert not is_plausible(3.001 * true)
    assert not is_plausible(true / 3.75)
    assert is_plausible(1.5 * tool.compliance) or tool.compliance < SUPPORT_COMPLIANCE / 3.5
    assert not is_plausible(1.5 * tool.compliance, 0.99 * tool.frequency)


def test_a_tip_that_is_as_compliant_as_its_tool_serves_instead(plain: Shop) -> None:
    described = '[[tool]]\nname = "plain"\ndiameter_mm = 50\ntool_material = "carbide"\nstick_out_mm = {}\n\n'
    text = plain.path.joinpath("machine.toml").read_text("utf-8")
    tap_both(plain)
    found = []
    for length in (163, 130, 220):  # the tip is 1.4, 2.8 and 0.6 times as compliant as the tool alone
        marked = text.replace("[[program]]", described.format(length) + "[[program]]", 1)
        plain.path.joinpath("machine.toml").write_text(marked, "utf-8")
        found.append([check.evidence for check in verdict(plain).assembly.chain_checks])  # type: ignore[union-attr]
    assert found == [["tool-geometry"] * 2, [None] * 2, [None] * 2]


INPUT = """
[[daq.channel]]
input = {table.input}
quantity = "{table.quantity}"
model = "{table.model}"
range_v = 5
{key}
"""


def input_table(quantity: Any, model: str, sensitivity: float, gain: float = 1.0) -> ChannelTable:
    key = "sensitivity_mv_per_n" if quantity == "force" else "sensitivity_mv_per_g"
    values: dict[str, Any] = {key: sensitivity, "model": model, "gain": gain}
    return ChannelTable(0 if quantity == "force" else 1, quantity, 5.0, **values)


@pytest.mark.parametrize(
    ("model", "sensitivity", "gain", "fits"),
    [
        ("352A21", 10.4, 1, True),
        ("352A21", -10.4, 1, True),
        ("352A21", 30.0, 1, False),
        ("352A21", 3.3, 1, False),
        ("352A21", 12.0, 1, False),
        ("352C33", 10.4, 1, False),
        ("352A21", 1.04, 10, False),
        ("", 10.4, 1, False),
        ("086C03", 10.4, 1, False),
    ],
)
def test_sensitivities_fit_the_models_of_both_sensors(model: str, sensitivity: float, gain: float, fits: bool) -> None:
    tables = input_table("force", "086C03", 2.3), input_table("acceleration", model, sensitivity, gain)
    chain = SensorChain.of(DeviceIdentity("board", "1234"), [table.build().channel for table in tables])
    assert chain is not None
    assert fits_sensor_models(DaqTable(driver="dataq", channel=tables), chain) is fits
    recalibrated = input_table("force", "086C03", 2.4), tables[1]
    assert fits_sensor_models(DaqTable(driver="dataq", channel=recalibrated), chain) is fits
    other = SensorChain("1234", 3 * chain.force_v_per_n, chain.acceleration_v_per_m_s2, 5.0, 5.0)
    assert not fits_sensor_models(DaqTable(driver="dataq", channel=tables), other)


def test_sensor_models_serve_instead(plain: Shop) -> None:
    tables = input_table("force", "086C03", 2.25), input_table("acceleration", "352A21", 10.0)
    plain.edit("[daq]", '[daq]\ndriver = "dataq"')
    keys = "sensitivity_mv_per_n = 2.25", "sensitivity_mv_per_g = 10"
    text = "".join(INPUT.format(table=table, key=key) for table, key in zip(tables, keys, strict=True))
    with (plain.path / "machine.toml").open("a", encoding="utf-8") as file:
        file.write(text)
    tap_both(plain, sensors=[table.build().channel for table in tables])
    assert evidence(plain) == ["sensor-models"] * 2


@pytest.mark.parametrize(("share", "found"), [(1.3, "emulator"), (1 / 3, None)])
def test_the_check_of_an_emulator_counts_unless_the_model_contradicts(
    shop: Shop, share: float, found: str | None
) -> None:
    with_error = entered(share)
    shop.run(("A", 12900, 0.05))
    tap_both(shop, sensors=with_error, tool="reference", device="emulator, serial number EMULATED")
    assert evidence(shop) == [None, None]
    store_emulator_check(shop.folder, with_error)
    store_emulator_check(shop.folder, with_error)
    assert len(shop.folder.contents().mass_checks) == 1
    assert evidence(shop) == [found, found]


def test_the_sensitivity_of_an_emulator_that_is_changed_afterwards_is_not_checked(plain: Shop) -> None:
    store_emulator_check(plain.folder, SENSORS)
    tap_both(plain, device="emulator, serial number EMULATED")
    assert evidence(plain) == ["emulator"] * 2
    tap_both(plain, 1.0, entered(1.05), device="emulator, serial number EMULATED")
    assert evidence(plain) == [None, None]


def test_a_stored_verdict_follows_the_check(plain: Shop) -> None:
    tap_both(plain)
    newest = Logbook.open(plain.path).taps[-1].id
    assert Logbook.open(plain.path).stored_verdicts(newest)["A"].stability is Stability.DOUBTFUL
    chain = SensorChain("1234", 2.25e-3, 1.02e-3, 5.0, 5.0)
    store_mass_check(plain.folder, MassCheckEntry("", DAY, 1.2, 1.0, 0.001, True, chain))
    assert Logbook.open(plain.path).stored_verdicts(newest)["A"].stability is Stability.STABLE


def test_a_check_changes_no_stored_row_but_what_is_shown(plain: Shop) -> None:
    def shown() -> set[str]:
        logbook = Logbook.open(plain.path)
        newest = logbook.checked_history.rows[-1].verdicts or {}
        return {newest["A"].stability, summarize_machine(logbook, DAY).programs["A"]}

    tap_both(plain)
    assert shown() == {Stability.DOUBTFUL}
    stored = plain.folder.history_path.read_bytes()
    hit_mass(plain, 1.0)
    assert shown() == {Stability.STABLE}
    hit_mass(plain, 5.0, serial="99")
    hit_mass(plain, 0.5, ratio=2.0)
    assert shown() == {Stability.STABLE}
    assert plain.folder.history_path.read_bytes() == stored
    (row,) = [row for row in Logbook.open(plain.path).history.rows if row.direction == "y"]
    assert row.verdicts is not None
    assert row.verdicts["A"].stability is Stability.STABLE


def test_a_check_keeps_the_acknowledgement_of_an_alarm(plain: Shop) -> None:
    text = plain.path.joinpath("machine.toml").read_text("utf-8")
    plain.path.joinpath("machine.toml").write_text(text.replace("depth_mm = 0.05", "depth_mm = 5"), "utf-8")
    for number in range(2):
        tap_both(plain, 30.0 * number)
        Logbook.open(plain.path).status(DAY + timedelta(days=30 * number))
    alarms = [alarm.id for alarm in Logbook.open(plain.path).status(DAY + timedelta(days=31)).alarms]
    assert alarms
    hit_mass(plain, 31.0)
    assert [alarm.id for alarm in Logbook.open(plain.path).status(DAY + timedelta(days=31)).alarms] == alarms


@pytest.mark.parametrize(
    ("ratio", "found"), [(1.1, "model"), (1.5, "tool-geometry"), (1 / 1.5, "tool-geometry"), (2.1, None), (0.4, None)]
)
def test_the_geometry_serves_where_the_drawing_is_roughly_right(shop: Shop, ratio: float, found: str | None) -> None:
    chain = SensorChain("1234", 2.25e-3, 1.02e-3, 5.0, 5.0)
    beam = find_tool_beam(with_tool(shop.folder.machine), "t")
    assert beam is not None
    row = HistoryRow(
        *("a", DAY, "t", "x"),
        stiffness=Estimate(ratio * 1e6, 1.0),
        modal_tip_stiffness=1e6,
        tip_compliance=1.4 * beam.compliance,
        highest_frequency=2e4,
    )
    entry = TapEntry("a", "", 1, DAY.isoformat(), "t", "x", "", chain=chain)
    check = ChainChecks(with_tool(shop.folder.machine), [row], {"a": entry}, (), "m").check("a")
    assert check.evidence == found


def with_tool(machine: Machine) -> Machine:
    tool = ToolTable(name="t", diameter_mm=16, stick_out_mm=100, tool_material="carbide")
    return msgspec.structs.replace(machine, tool=(tool,))
