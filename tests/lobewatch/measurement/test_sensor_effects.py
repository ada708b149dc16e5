"""The accelerometer that rides on the structure: taken off, asked for, and what its mounting does."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Circumstances, DataError, Frf, TapTest, from_accelerance, new_tap_id
from lobewatch.cli import app
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.setup_tables import SensorLoading
from lobewatch.measurement.tap_measurement import TapFit, fit_tap
from modal import Mode, synthesize_frf

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
LINES = np.arange(4.0, 4000.0, 4.0)
MODES = [Mode(1500.0, 0.03, 3e7), Mode(2600.0, 0.03, 6e7)]
TOML = '[machine]\nname = "m"\n[tap]\n'


def measured(mass: float = 0.010, sign: float = 1.0, modes: list[Mode] = MODES) -> Frf:
    """Through an accelerometer of this mass (kg), with noise of 0.2 % of the largest accelerance."""
    free = synthesize_frf(modes, LINES).receptance
    loaded = -sign * (2 * np.pi * LINES) ** 2 / (1 / free - mass * (2 * np.pi * LINES) ** 2)
    random = np.random.default_rng(0).normal(size=(2, LINES.size)) * 0.002 * np.max(np.abs(loaded))
    return from_accelerance(LINES, loaded + random[0] + 1j * random[1])


def fit(frf: Frf, *settings: str) -> TapFit:
    """With these lines in [tap]."""
    about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC))
    return fit_tap(TapTest(new_tap_id(about), about, frf), parse_machine_file(TOML + "\n".join(settings)))


def codes(tap: TapFit) -> list[str]:
    return [remark.code for remark in tap.remarks]


def test_a_named_sensor_is_taken_off_and_its_uncertainty_is_in_the_errors() -> None:
    tap = fit(measured(), "sensor_mass_g = 10", 'mounting = "wax"')
    for mode, true in zip(tap.modes, MODES, strict=True):
        low, high = mode.interval().T
        assert low[0] < true.frequency < high[0]
        assert low[2] < true.stiffness < high[2]
    assert codes(tap) == ["sensor-mass-removed"]
    assert all(mass in tap.remarks[0].text for mass in ("10 g", "0.2 g"))
    cable = fit(measured(), "sensor_mass_g = 5", "cable_mass_g = 10", 'mounting = "wax"')
    assert cable.modes[0].frequency == pytest.approx(tap.modes[0].frequency)
    assert cable.modes[0].standard_error[0] > 3 * tap.modes[0].standard_error[0]


def test_nobody_named_it_asks_where_ten_grams_matter() -> None:
    tap = fit(measured(), 'mounting = "glue"')
    assert tap.modes[0].frequency == pytest.approx(1478, abs=3)
    (asked,) = tap.remarks
    assert asked.code == "sensor-mass-unknown"
    assert "[tap] sensor_mass_g" in asked.cure
    assert codes(fit(measured(), 'mounting = "glue"', "sensor_mass_g = 0")) == []
    receptance = Frf(LINES, measured().receptance)
    assert codes(fit(receptance, 'mounting = "glue"')) == []
    assert codes(fit(measured(modes=[Mode(150.0, 0.03, 3e8)]), 'mounting = "glue"')) == []


@pytest.mark.parametrize(("stiffness", "fall", "also"), [(3e7, -1.4, " and stiffness by +0 %"), (4e4, -79, "")])
def test_what_ten_grams_would_do_is_reported_however_light_the_structure_is(
    stiffness: float, fall: float, also: str
) -> None:
    """Expect f / sqrt(1 + m / M) for M = K / w^2 = 0.338 kg and m = 0.45 g."""
    tap = fit(measured(0.0, modes=[Mode(1500.0, 0.03, stiffness)]), 'mounting = "glue"')
    (asked,) = tap.remarks
    assert f"frequency by {fall} %{also}, " in asked.text


def test_of_a_response_next_to_the_hammer_nothing_is_taken_off() -> None:
    against = measured(0.0, sign=-1.0)
    tap = fit(against, "sensor_mass_g = 10", 'mounting = "glue"')
    assert codes(tap) == ["sensor-mass-stays"]
    assert tap.modes[0].frequency == pytest.approx(1500, rel=1e-3)
    assert codes(fit(against, 'mounting = "glue"')) == []


def test_a_magnet_reads_k_14_percent_low_at_2600_hz_and_says_so() -> None:
    (asked,) = fit(measured(0.0), "sensor_mass_g = 0", 'mounting = "magnet"').remarks
    assert (asked.code, asked.about) == ("mounting-resonance", "2600 Hz")
    assert all(fact in asked.text for fact in ("held by magnet", " 7 kHz", " 14 % low"))
    (unsaid,) = fit(measured(0.0), "sensor_mass_g = 0").remarks
    assert "[tap] mounting" in unsaid.cure
    for fine in ("stud", "glue", "wax"):
        assert codes(fit(measured(0.0), "sensor_mass_g = 0", f'mounting = "{fine}"')) == []


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("sensor_mass_g = -1", "sensor_mass_g"),
        ("sensor_mass_g = 5000", "sensor_mass_g"),
        ("cable_mass_g = 5", "cable_mass_g=5 .*sensor_mass_g"),
        ('mounting = "tape"', "mounting"),
    ],
)
def test_what_no_sensor_is_is_rejected(line: str, words: str) -> None:
    with pytest.raises(DataError, match=words):
        parse_machine_file(f"{TOML}{line}")


def test_grams_of_an_option_are_checked() -> None:
    assert SensorLoading.of(10.0, 4.0).mass == pytest.approx(0.012)
    for wrong in (-1.0, float("nan"), 3000.0):
        with pytest.raises(ValueError, match=rf"{wrong:g} g.* 0 to 2000"):
            SensorLoading.of(wrong)


def test_rows_follow_the_sensor_of_machine_toml(shop: Shop) -> None:
    shop.put("")
    shop.tap(0.0, 1713.0)
    before = shop.logbook.history.rows[-1].frequency.value
    shop.edit("sensor_mass_g = 0 ", "sensor_mass_g = 10 ")
    after = shop.logbook.history.rows[-1].frequency.value
    assert after / before == pytest.approx(1 / (1 - 0.0166), abs=0.001)


def test_of_a_file_the_mass_is_an_option(tmp_path: Any) -> None:
    path, frf = tmp_path / "frf.csv", measured()
    rows = zip(LINES.tolist(), frf.accelerance.tolist(), strict=True)
    text = "".join(f"{f:.6g},{a.real:.9e},{a.imag:.9e}\n" for f, a in rows)
    path.write_text(f"Freq (Hz),Real (m/s^2/N),Imag (m/s^2/N)\n{text}", encoding="utf-8")
    said = CliRunner().invoke(app, ["modes", str(path)]).stdout
    assert "10 g would change the frequency" in said
    taken = CliRunner().invoke(app, ["modes", str(path), "--sensor-mass", "10"]).stdout
    assert "10 g of accelerometer and cable" in taken
    assert "1500" in taken
