"""Drivers of other packages: found, rejected with the name of their package, and probed only if the vendor fits."""

from __future__ import annotations

import os
import tty
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition import (
    DataError,
    DeviceIdentity,
    DeviceSettings,
    Driver,
    find_driver,
    list_driver_names,
    load_drivers,
    probe_port,
)
from acquisition.devices.drivers import BUILT_IN_DRIVERS
from acquisition.ports import SerialLink

pytestmark = pytest.mark.quick

PLUGINS = Path(__file__).parents[2] / "plugins"
Install = Callable[[str, str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Install a package with a driver `odd`: its name, and what the entry point leads to."""

    def put(package: str, target: str) -> None:
        folder = tmp_path / package
        metadata = folder / f"{package}-1.0.dist-info"
        metadata.mkdir(parents=True)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", "utf-8")
        (metadata / "entry_points.txt").write_text(f"[lobewatch.drivers]\nodd = {target}\n", "utf-8")
        monkeypatch.syspath_prepend(folder)

    return put


def test_ours_come_first_and_a_package_adds_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = ("taps", "dataq", "lines", "audio", "nidaqmx", "mcc172", "uldaq", "ljm")
    assert list_driver_names() == ours
    monkeypatch.syspath_prepend(PLUGINS / "dummy_device")
    assert list_driver_names() == (*ours, "dummy")
    dummy = find_driver("dummy")
    assert (dummy.name, dummy.title) == ("dummy", "a dummy device")
    assert load_drivers() == ((*BUILT_IN_DRIVERS, dummy), ())


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("no_such_module:DRIVER", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("acquisition.devices.drivers:NOTHING", "AttributeError: "),
        ("acquisition.devices.registry:DRIVER_ENTRY_POINTS", "acquisition.Driver"),
        ("acquisition.devices.drivers:BUILT_IN_DRIVERS.__class__", "acquisition.Driver"),
    ],
)
def test_what_is_no_driver_is_rejected_with_the_name_of_its_package(
    install: Install, target: str, message: str
) -> None:
    install("bad", target)
    with pytest.raises(DataError) as caught:
        find_driver("odd")
    assert str(caught.value).startswith("driver 'odd': ")
    assert "package bad " in str(caught.value)
    assert message in str(caught.value)
    drivers, (remark,) = load_drivers()
    assert drivers == BUILT_IN_DRIVERS
    assert (remark.code, str(remark)) == ("package-not-loaded", str(caught.value))


def test_a_driver_under_another_name_is_rejected(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(PLUGINS / "dummy_device")
    install("liar", "lobewatch_dummy_device:DRIVER")
    with pytest.raises(DataError, match=r"driver 'odd': .*liar .*'dummy'"):
        find_driver("odd")


def test_two_packages_with_one_driver_are_both_named(install: Install) -> None:
    install("first", "a:b")
    install("second", "c:d")
    with pytest.raises(DataError, match=r"driver 'odd': .*first and second"):
        find_driver("odd")


def test_a_name_that_nobody_brings() -> None:
    with pytest.raises(DataError, match=r"driver='odd' .*taps, dataq, .*ljm"):
        find_driver("odd")


@pytest.fixture
def port() -> Iterator[str]:
    """Open a pseudo-terminal that never answers."""
    ends = os.openpty()
    tty.setraw(ends[1])
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


@pytest.mark.parametrize(
    ("vendor", "asked"),
    [(None, ["any", "one", "other"]), (0x1111, ["one"]), (0x2222, ["one", "other"]), (0x3333, ["any"])],
)
def test_only_drivers_that_fit_the_vendor_are_asked(port: str, vendor: int | None, asked: list[str]) -> None:
    heard: list[str] = []

    def driver(name: str, *vendors: int) -> Driver:
        def probe(_link: SerialLink) -> DeviceIdentity | None:
            heard.append(name)
            return None

        return replace(BUILT_IN_DRIVERS[0], name=name, probe=probe, usb_vendors=frozenset(vendors))

    drivers = driver("any"), driver("one", 0x1111, 0x2222), driver("other", 0x2222)
    assert probe_port(port, drivers, vendor) is None
    assert heard == asked


def test_the_first_answer_counts(port: str) -> None:
    who = DeviceIdentity("X", "1", "2")

    def driver(name: str, identity: DeviceIdentity | None) -> Driver:
        return replace(BUILT_IN_DRIVERS[0], name=name, probe=lambda _: identity)

    drivers = driver("silent", None), driver("answering", who), driver("later", DeviceIdentity("Y"))
    found = probe_port(port, drivers)
    assert found is not None
    assert (found.driver, found.identity) == ("answering", who)


def test_a_driver_takes_all_settings_unless_it_says_otherwise() -> None:
    driver = Driver("x", "a thing", BUILT_IN_DRIVERS[0].open, BUILT_IN_DRIVERS[0].probe)
    driver.check(DeviceSettings(1.0, (), loss_detection=False))
