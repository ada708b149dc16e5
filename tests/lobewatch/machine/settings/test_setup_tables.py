"""[daq] and [[daq.channel]] of machine.toml: units, and every mistake reported with table and key."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

import pytest

from acquisition import Channel, DataError, SensorInput
from lobewatch.machine.settings.machine_file import parse_machine_file

pytestmark = pytest.mark.quick

PLUGIN = Path(__file__).parents[3] / "plugins" / "dummy_device"
HEAD = '[machine]\nname = "mill 3"\n'
DAQ = """
[daq]
driver = "dataq"

[[daq.channel]]
input = 2
quantity = "force"
sensitivity_mv_per_n = 2.25
range_v = 5

[[daq.channel]]
input = 3
quantity = "acceleration"
sensitivity_mv_per_g = -10
gain = 10
range_v = 0.5
direction = "x"
serial_number = "A-0815"
calibration_date = 2026-01-15
skew_us = 6.5
"""


def test_channels_are_converted_at_the_door() -> None:
    force, acceleration = (channel.build() for channel in parse_machine_file(HEAD + DAQ).daq.channel)
    assert force == SensorInput(2, Channel("force", 2.25e-3, 5.0))
    assert acceleration.number == 3
    channel = acceleration.channel
    assert channel.sensitivity == pytest.approx(-10e-3 * 10 / 9.80665)  # V at the device per m/s^2
    assert (channel.full_scale, channel.direction, channel.serial_number) == (0.5, "x", "A-0815")
    assert channel.calibration_date == "2026-01-15"
    assert channel.skew == pytest.approx(6.5e-6)
    assert -9.80665 / 10 * channel.full_scale / 32768 / 10e-3 == pytest.approx(channel.scale)


@pytest.mark.parametrize(
    ("old", "new", "facts"),
    [
        ("input = 2", "input = 8", "daq: input=8 .*0 to 7"),
        ("input = 2", "input = 3", "daq: channel 2: input=3 .*channel 1"),
        ("input = 2\n", "", "daq channel 1: .*'input'"),
        ('"force"', '"acceleration"', "daq channel 1: quantity='acceleration' .*sensitivity_mv_per_g"),
        ('"force"', '"temperature"', "daq channel 1 quantity: .*'temperature'.* 'force', 'acceleration'"),
        ("sensitivity_mv_per_n = 2.25\n", "", "daq channel 1: .*sensitivity_mv_per_n .*sensitivity_mv_per_g"),
        (
            "sensitivity_mv_per_n = 2.25",
            "sensitivity_mv_per_n = 2\nsensitivity_mv_per_g = 1",
            "daq channel 1: .*sensitivity_mv_per_n .*sensitivity_mv_per_g",
        ),
        ("sensitivity_mv_per_n = 2.25", "sensitivity_mv_per_n = 0", "daq channel 1: sensitivity_mv_per_n=0"),
        ("sensitivity_mv_per_n = 2.25", "sensitivity_mv_per_n = nan", "daq channel 1 sensitivity_mv_per_n: "),
        ("sensitivity_mv_per_n", "sensitivity_v_per_n", "'sensitivity_v_per_n'.* 'sensitivity_mv_per_n'"),
        ("gain = 10", "gain = -1", "daq channel 2 gain: "),
        ("range_v = 0.5", "range_v = 0", "daq channel 2 range_v: "),
        ('"x"', '"z"', "daq channel 2 direction: .*'z'"),
        ("2026-01-15", '"last spring"', "daq channel 2 calibration_date: "),
        ("skew_us = 6.5", "skew_us = inf", "daq channel 2 skew_us: "),
        (
            'driver = "dataq"',
            'driver = "ni"',
            "daq: .*'ni'.* taps, dataq, lines, audio, nidaqmx, mcc172, uldaq, ljm",
        ),
        ('driver = "dataq"', "", "daq: channel: .*TAPS/1"),
        ('driver = "dataq"', "loss_detection = false", "daq: channel: .*TAPS/1"),
    ],
)
def test_every_mistake_is_reported_with_its_table_and_key(old: str, new: str, facts: str) -> None:
    assert old in DAQ
    with pytest.raises(DataError, match=facts) as caught:
        parse_machine_file(HEAD + DAQ.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_a_dataq_device_needs_its_sensors_and_a_taps_device_its_loss_detection() -> None:
    with pytest.raises(DataError, match=r"\[\[daq.channel\]\].* force .*acceleration"):
        parse_machine_file(HEAD + '[daq]\ndriver = "dataq"\n')
    with pytest.raises(DataError, match=r"daq: loss_detection=false.* TAPS/1"):
        parse_machine_file(HEAD + "[daq]\nloss_detection = false\n")
    with pytest.raises(DataError, match=r"daq: digital_clock=true.* TAPS/1"):
        parse_machine_file(HEAD + "[daq]\ndigital_clock = true\n")
    clock = HEAD + DAQ.replace('driver = "dataq"', 'driver = "dataq"\ndigital_clock = true')
    assert parse_machine_file(clock).daq.settings.digital_clock
    with pytest.raises(DataError, match="daq: digital_clock=true"):
        parse_machine_file(clock.replace("digital_clock", "loss_detection = false\ndigital_clock"))


AXIS = '[[daq.channel]]\ninput = {}\nquantity = "acceleration"\nsensitivity_mv_per_g = 100\nrange_v = 1.6\n{}\n'
BOARD = HEAD + '[tap]\nhammer = "none"\n[daq]\ndriver = "lines"\nsample_rate_hz = 3200\n'


@pytest.mark.parametrize(
    ("axes", "facts"),
    [
        ([(0, ""), (1, ""), (2, "")], "3 channels of acceleration.* direction"),
        ([(0, 'direction = "x"'), (1, 'direction = "x"')], "2 channels of acceleration.* direction"),
        ([(0, 'direction = "x"'), (1, ""), (1, "")], "channel 3: input=1 .*channel 2"),
        ([(0, 'direction = "x"'), (1, ""), (3, "")], "0 to 2"),
    ],
)
def test_axes_that_cannot_be_classified_apart_are_rejected(axes: list[tuple[int, str]], facts: str) -> None:
    with pytest.raises(DataError, match=facts):
        parse_machine_file(BOARD + "".join(AXIS.format(*axis) for axis in axes))


def test_three_axes_are_read_and_need_the_hammer_to_be_none() -> None:
    text = BOARD + "".join(
        AXIS.format(i, f'direction = "{name}"' if name else "") for i, name in enumerate(("x", "y", ""))
    )
    assert [channel.direction for channel in parse_machine_file(text).daq.channel] == ["x", "y", ""]
    with pytest.raises(DataError, match=r"daq: .*force.*hammer"):
        parse_machine_file(text.replace('hammer = "none"', ""))


def test_the_driver_of_a_package_checks_its_own_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    dummy = HEAD + '[daq]\ndriver = "dummy"\n'
    with pytest.raises(DataError, match=r"daq: .*'dummy'.* taps, dataq, .*ljm"):
        parse_machine_file(dummy)
    monkeypatch.syspath_prepend(PLUGIN)
    assert parse_machine_file(dummy).daq.driver == "dummy"
    with pytest.raises(DataError, match=r"daq: sample_rate_hz=1000 .*25600"):
        parse_machine_file(dummy + "sample_rate_hz = 1000\n")
    with pytest.raises(DataError, match=r"daq: channel: a dummy device .*\[\[daq.channel"):
        parse_machine_file(HEAD + DAQ.replace('"dataq"', '"dummy"'))


@pytest.mark.parametrize("name", ["new_machine.toml", "surrogate_machine.toml"])
def test_what_the_machine_files_show_in_comments_is_right(name: str) -> None:
    text = resources.files("sim_data").joinpath(name).read_text("utf-8")
    start, end = text.index('# driver = "dataq"'), text.index("[mode]")
    shown = re.sub("^# ", "", text[start:end], flags=re.MULTILINE)
    daq = parse_machine_file(text[:start] + shown + text[end:]).daq
    assert [channel.build().channel.quantity for channel in daq.channel] == ["force", "acceleration"]


def test_the_examples_in_the_documentation_are_right() -> None:
    page = (Path(__file__).parents[4] / "docs" / "devices.md").read_text("utf-8")
    shown = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    channels = shown[0][shown[0].index("[[daq.channel]]") :]
    for example, driver in zip(shown, ("dataq", "lines", "audio"), strict=True):
        daq = parse_machine_file(HEAD + example + ("" if "[[daq.channel]]" in example else channels)).daq
        assert daq.driver == driver
        assert [channel.build().channel.full_scale for channel in daq.channel] == [5.0, 5.0]
