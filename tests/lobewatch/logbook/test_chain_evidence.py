"""Evidence for the sensors other than a mass: spindle model, tool, another tool, printed sensitivities."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.source import DeviceIdentity
from lobewatch.fleet.summarize import summarize_machine
from lobewatch.history.chain_checks import ChainChecks
from lobewatch.history.history import HistoryRow
from lobewatch.logbook import Logbook
from lobewatch.machine import Machine
from lobewatch.machine.folder_updates import store_mass_check
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.settings.setup_tables import ChannelTable, DaqTable
from lobewatch.machine.settings.spindle_tables import ToolTable
from lobewatch.measurement.estimate import Estimate
from lobewatch.measurement.sensor_models import fits_sensor_models
from lobewatch.measurement.tool_compliance import SUPPORT_COMPLIANCE, ToolBeam, find_tool_beam, has_plausible_size
from lobewatch.tap.mass_check import store_emulator_check
from lobewatch.verdicts import Stability
from tests.lobewatch.logbook.conftest import DAY, SENSORS, Shop, entered, evidence, hit_mass, tap, tap_both, verdict


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
